"""matplotlib, as the figures use it: its defaults with hilrig's own style on top. The only file that imports it.

What the user has set for other figures, in a matplotlibrc or in MPLBACKEND, neither shapes nor prevents these.
"""

from __future__ import annotations

import locale
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from hilrig.core.errors import HilrigError
from hilrig.report.style import RC


@contextmanager
def _without_backend() -> Iterator[None]:
    """Keep MPLBACKEND from an import of matplotlib, which would fail where that backend is not installed.

    Jupyter sets it for all commands that a notebook starts. Figures are written to files here and need no backend;
    a program that uses hilrig as a library gets the one that it asked for, if there is one.
    """
    first = "matplotlib" not in sys.modules
    backend = os.environ.pop("MPLBACKEND", None) if first else None
    try:
        yield
    except (OSError, ValueError, locale.Error) as error:
        raise HilrigError(
            f"matplotlib cannot read its settings: {error}; look for a file matplotlibrc here or in your home folder, "
            "and at the variables MATPLOTLIBRC and MPLCONFIGDIR"
        ) from error
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    if backend:
        with suppress(ValueError):
            sys.modules["matplotlib"].rcParams["backend"] = backend


with _without_backend():
    import matplotlib as mpl
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke
    from matplotlib.textpath import TextPath
    from matplotlib.ticker import LogLocator, NullFormatter

__all__ = [
    "Axes", "Figure", "FontProperties", "Line2D", "LogLocator", "NullFormatter", "TextPath", "figure_style",
    "withStroke",
]  # fmt: skip


@contextmanager
def figure_style() -> Iterator[None]:
    """Have figures drawn and saved in hilrig's style; afterwards the user's settings are as before."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(RC)
        yield

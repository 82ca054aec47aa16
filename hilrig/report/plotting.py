"""matplotlib with its defaults and hilrig's own style. The only file that imports it.

The user's settings for other figures, in a matplotlibrc or in MPLBACKEND, have no effect here.
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
    """Hide MPLBACKEND while matplotlib is imported, which would fail if that backend is not installed.

    Jupyter sets it for all commands that a notebook starts. Figures are written to files and need no backend here; a
    program that uses hilrig as a library still gets the one it asked for, if available.
    """
    first = "matplotlib" not in sys.modules
    backend = os.environ.pop("MPLBACKEND", None) if first else None
    try:
        yield
    except (OSError, ValueError, locale.Error) as error:
        raise HilrigError(
            f"matplotlib cannot read its settings: {error}; check for a file matplotlibrc here "
            "or in your home folder, and the variables MATPLOTLIBRC and MPLCONFIGDIR"
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
    """Draw and save figures in hilrig's style; the user's settings are restored afterwards."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(RC)
        yield

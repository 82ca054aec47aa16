from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hilrig.core.errors import LONGEST, PluginError, authors_line, describe_error, raised
from hilrig.core.parameters import per_axis


class SilentError(Exception):
    def __str__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (RuntimeError("no  calibration\nfound"), "RuntimeError: no calibration found"),
        (AssertionError(), "AssertionError"),
        (SystemExit(0), "sys.exit(0) was called"),
        (SilentError(), "SilentError"),
        (PluginError("as it is"), "as it is"),
    ],
)
def test_an_exception_is_described_in_one_line(error: BaseException, words: str) -> None:
    assert describe_error(error) == words


def test_a_long_message_is_cut() -> None:
    assert len(raised(ValueError("x" * 10_000))) == len("ValueError: ") + LONGEST


def caught(tmp_path: Path, code: str) -> BaseException:
    """Return what a file of the user's raises."""
    path = tmp_path / "mine.py"
    path.write_text(code)
    try:
        exec(compile(code, str(path), "exec"), {"np": np, "json": json, "per_axis": per_axis})
    except Exception as error:
        return error
    raise AssertionError("nothing was raised")


@pytest.mark.parametrize(
    ("code", "line"),
    [
        ("x = 1\ny = x / 0\n", 2),
        ("\nnp.linalg.inv(np.zeros((2, 3)))\n", 2),  # raised in an installed library
        ("\n\njson.loads('{')\n", 3),  # raised in Python's own
        ("per_axis((1.0, 2.0, 3.0), 2, 'gain')\n", 1),  # raised in hilrig
        ("def f():\n    return g()\ndef g():\n    return f()\nf()\n", 4),
    ],
)
def test_an_error_is_the_authors_wherever_it_was_raised(tmp_path: Path, code: str, line: int) -> None:
    error = caught(tmp_path, code)
    assert isinstance(error, RecursionError) or authors_line(error) == (str(tmp_path / "mine.py"), line)
    assert " at mine.py:" in describe_error(error)


def test_a_library_counts_if_it_is_the_kinds_own(tmp_path: Path) -> None:
    error = caught(tmp_path, "np.linalg.inv(np.zeros((2, 3)))\n")
    found = authors_line(error, "numpy")
    assert found is not None
    assert Path(found[0]).parts[-2] == "linalg"

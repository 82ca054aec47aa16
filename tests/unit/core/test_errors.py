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
    ("slip", "mended"),
    [
        ("memory.n += 1  # ticks", "memory.n[:] += 1"),
        ("memory.n = memory.n + 1", "memory.n[:] = memory.n + 1"),
        ("if memory.n == 0: memory.n -= 1", "memory.n[:] -= 1"),
        ("setattr(memory, 'n', 1)", "memory.n[:] += 1"),
    ],
)
def test_a_field_of_a_named_tuple_that_is_set_is_told_what_to_write(tmp_path: Path, slip: str, mended: str) -> None:
    error = caught(
        tmp_path, f"from collections import namedtuple\nmemory = namedtuple('M', 'n')(np.zeros(1))\n{slip}\n"
    )
    assert raised(error) == f"AttributeError: can't set attribute; write into the array of the NamedTuple: `{mended}`"


def test_so_is_one_that_is_set_in_compiled_code(tmp_path: Path) -> None:
    error = caught(
        tmp_path,
        "from typing import NamedTuple\nimport numba\nclass Memory(NamedTuple):\n    n: np.ndarray\n"
        "@numba.njit\ndef step(memory):\n    memory.n += 1\nstep(Memory(np.zeros(1)))\n",
    )
    assert raised(error).endswith("; write into the array of the NamedTuple: `memory.n[:] = ...`")


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

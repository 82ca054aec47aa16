"""Every error whose message is meant for the user.

HilrigError
├── ExperimentError   the experiment file, or the call, is wrong; carries the place in the file   (exit 2)
├── RunDirectoryError a run directory is missing, incomplete or not one                           (exit 2)
├── PluginError       a plug-in cannot be found or does not provide its interface                 (exit 2)
├── OutOfReach        a position that the robot cannot reach
├── Tripped           a safety limit was exceeded                        (the trial's outcome)
├── Stopped           a trial was told to end before its last tick       (the trial's outcome)
├── TimedOut          a stage of the plant's life took too long          (the trial's outcome)
└── RigError          a process of the rig failed, vanished or did not answer in time             (exit 1)
"""

from __future__ import annotations

import difflib
import linecache
import os
import re
import traceback
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple


class HilrigError(Exception):
    """Base class of all errors whose message is shown to the user without a traceback."""


class PluginError(HilrigError):
    """A kind cannot be loaded, or does not provide the interface of its group."""


class RunDirectoryError(HilrigError):
    """A directory is not a run, or the run lacks what was requested."""


class RigError(HilrigError):
    """A process of the rig failed, vanished, or did not answer in time."""


class Tripped(HilrigError):
    """A safety limit was exceeded; the message names the limit, the value and the tick."""


class Stopped(HilrigError):
    """The trial was told to end before its last tick."""


class TimedOut(HilrigError):
    """A stage before or after the ticks took longer than it may."""


class OutOfReach(HilrigError):
    """A position outside the robot's workspace."""


class Place(NamedTuple):
    """A place in a text file; line and column count from 1. Line 0 stands for the whole file."""

    file: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


class Problem(NamedTuple):
    """One thing that is wrong, and where."""

    place: Place | None
    message: str

    def __str__(self) -> str:
        return f"{self.place}: {self.message}" if self.place else self.message


class ExperimentError(HilrigError):
    """The experiment cannot be run as written. All problems found are in `problems`."""

    def __init__(self, problems: Iterable[Problem] | str) -> None:
        listed = [Problem(None, problems)] if isinstance(problems, str) else list(problems)
        self.problems: tuple[Problem, ...] = tuple(listed)
        super().__init__("\n".join(str(problem) for problem in self.problems))


LONGEST = 500
"""Maximum characters shown of an exception's message; some libraries write pages"""


def raised(error: BaseException) -> str:
    """Return the exception's type and message in one line."""
    if isinstance(error, SystemExit):
        return f"sys.exit({error.code!r}) was called"
    text = one_line(error)
    return f"{type(error).__name__}: {text}{_remedy(text, error)}" if text else type(error).__name__


_FIELD_SET = re.compile(r"([\w.]+\.\w+)\s*((?:[-+*/%@&|^]|//|\*\*)?=(?!=)[^#]*)")
"""An assignment to a field, such as `memory.n += 1`: the field, and the rest"""
_COMPILED = re.compile(r"No definition for lowering .*\.(\w+) = ")
"""What numba says of one"""


def _remedy(text: str, error: BaseException) -> str:
    """Return what to write in place of `memory.n += 1`, which Python refuses in three words; empty for other errors."""
    if compiled := _COMPILED.match(text):
        target, rest = f"memory.{compiled[1]}", "= ..."
    elif text == "can't set attribute":
        place = authors_line(error)
        found = _FIELD_SET.search(linecache.getline(*place)) if place else None
        target, rest = found.groups() if found else ("memory.n", "+= 1")
    else:
        return ""
    return f"; write into the array of the NamedTuple: `{target}[:] {rest.strip()}`"


def one_line(error: BaseException) -> str:
    """Return an exception's message in one line, shortened to `LONGEST` characters."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # the exception and its __str__ are plug-in code
        return ""
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def authors_line(error: BaseException, package: str = "") -> tuple[str, int] | None:
    """Return file and line of the innermost frame of plug-in code that an exception passed through; None if none.

    Plug-in code is outside hilrig, Python and installed libraries; `package` is an installed one that also counts.
    """
    ours, python = str(Path(__file__).parents[1]) + os.sep, str(Path(os.__file__).parent) + os.sep
    found = None
    for frame, line in traceback.walk_tb(error.__traceback__):
        file = frame.f_code.co_filename
        installed = file.startswith(python) or "site-packages" in file or "dist-packages" in file
        own = bool(package) and str(frame.f_globals.get("__name__")).partition(".")[0] == package
        if not file.startswith((ours, "<")) and (own or not installed):
            found = (file, line)
    return found


def describe_error(error: BaseException) -> str:
    """Return what was raised in one line and, if not meant for the user, where: in the author's code if known."""
    if isinstance(error, HilrigError):
        return str(error)
    if isinstance(error.__cause__, StopIteration):  # a tick is part of a generator, which turns it into RuntimeError
        error = error.__cause__
    frames = traceback.extract_tb(error.__traceback__)
    file, line = authors_line(error) or ((frames[-1].filename, frames[-1].lineno) if frames else ("", 0))
    return f"{raised(error)} at {Path(file).name}:{line}" if file else raised(error)


def nearest(name: str, choices: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" for the choice most similar to `name`, or an empty string."""
    match = difflib.get_close_matches(str(name), [str(choice) for choice in choices], n=1, cutoff=0.6)
    return f"; did you mean '{match[0]}'?" if match else ""

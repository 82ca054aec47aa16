"""A folder for the sockets of one bus, at a path that an endpoint of zenoh and a unix socket can hold."""

from __future__ import annotations

import os
import re
import tempfile
from contextlib import suppress

from hilrig.core.errors import RigError

PREFIX = "hilrig-"
LONGEST_SOCKET_PATH = 107
"""Bytes; Linux keeps 108 for it, and the last is a zero"""
LONGEST_NAME = len(f"/{PREFIX}12345678/s.sock")

# An endpoint is <protocol>/<path>?<metadata>#<configuration>, in which ; and = also have a meaning. zenoh cuts the path
# at the first ? or # and says nothing. Without the other odd characters one need not know what each part makes of them.
_PLAIN = re.compile(r"/[A-Za-z0-9/._+~@-]*")


def make_socket_folder() -> str:
    """Make a folder for sockets and return its path; the caller removes it.

    It is made in the user's temporary folder if that will do, else in another place for short-lived files. Raises
    RigError if there is none, saying of each why.
    """
    problems: list[str] = []
    for parent in _places():
        problem = _problem_with(parent)
        if problem is None:
            try:
                return tempfile.mkdtemp(prefix=PREFIX, dir=parent)
            except OSError as error:
                problem = str(error.strerror)
        problems.append(f"{parent!r}: {problem}")
    raise RigError(
        f"there is no folder for the sockets of the bus ({'; '.join(problems)}); set TMPDIR to a folder that can be "
        "written and has a short name of letters and digits"
    )


def _places() -> list[str]:
    with suppress(FileNotFoundError):  # no temporary folder can be written: then each of these is tried, and named
        return list(dict.fromkeys([tempfile.gettempdir(), *_other_places()]))
    return _other_places()


def _other_places() -> list[str]:
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return [*([runtime] if runtime else []), "/tmp", "/var/tmp", "/dev/shm"]


def _problem_with(folder: str) -> str | None:
    """Return why sockets cannot lie in a folder, as far as its path tells; None if they can."""
    if len(os.fsencode(folder)) + LONGEST_NAME > LONGEST_SOCKET_PATH:
        return f"a socket below it would have a path of more than {LONGEST_SOCKET_PATH} bytes"
    if not _PLAIN.fullmatch(folder):
        return "its path is not absolute, or has other characters than A-Z a-z 0-9 / . _ + ~ @ -"
    return None

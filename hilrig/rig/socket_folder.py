"""A folder for the sockets of one bus, at a path that fits into a zenoh endpoint and a unix socket address."""

from __future__ import annotations

import os
import re
import tempfile
from contextlib import suppress

from hilrig.core.errors import RigError

PREFIX = "hilrig-"
LONGEST_SOCKET_PATH = 107
"""Bytes; Linux reserves 108, and the last is a zero"""
LONGEST_NAME = len(f"/{PREFIX}12345678/s.sock")

# An endpoint is <protocol>/<path>?<metadata>#<configuration>, in which ; and = also have a meaning. zenoh silently cuts
# the path at the first ? or #. Other unusual characters are refused too, so their handling in each part does not
# matter.
_PLAIN = re.compile(r"/[A-Za-z0-9/._+~@-]*")


def endpoint(folder: str, participant: str) -> str:
    """Return where a participant of the bus listens: a unix socket in `folder`, named after its first letter."""
    return f"unixsock-stream/{folder}/{participant[0]}.sock"


def make_socket_folder() -> str:
    """Create a folder for sockets and return its path; the caller removes it.

    It is created in the user's temporary folder if possible, otherwise in another place for short-lived files. Raises
    RigError if no place is suitable, with the reason for each.
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
        f"there is no folder for the sockets of the bus ({'; '.join(problems)}); "
        "set TMPDIR to a writable folder with a short name of letters and digits"
    )


def _places() -> list[str]:
    with suppress(FileNotFoundError):  # no temporary folder is writable: then each of these is tried and named
        return list(dict.fromkeys([tempfile.gettempdir(), *_other_places()]))
    return _other_places()


def _other_places() -> list[str]:
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return [*([runtime] if runtime else []), "/tmp", "/var/tmp", "/dev/shm"]


def _problem_with(folder: str) -> str | None:
    """Return why a folder's path rules it out for sockets; None if it does not."""
    if len(os.fsencode(folder)) + LONGEST_NAME > LONGEST_SOCKET_PATH:
        return f"a socket below it would have a path of more than {LONGEST_SOCKET_PATH} bytes"
    if not _PLAIN.fullmatch(folder):
        return "its path is not absolute, or has characters other than A-Z a-z 0-9 / . _ + ~ @ -"
    return None

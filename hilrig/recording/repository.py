"""Asks git which commit an experiment belongs to, and what has changed since."""

from __future__ import annotations

import os
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

TIMEOUT_S = 10.0
"""Timeout of each git call, s: a run does not wait for a slow repository"""
LARGEST_DIFF_BYTES = 200_000

COMMAND = ("git", "--no-pager", "-c", "core.fsmonitor=false", "-c", "diff.relative=false")
# Without fsmonitor no daemon stays behind; with these prefixes `git apply` accepts the patch with any user
# settings.
DIFF = ("diff", "--no-color", "--no-ext-diff", "--no-textconv", "--src-prefix=a/", "--dst-prefix=b/", "HEAD")
STATUS = ("status", "--porcelain", "--untracked-files=normal")


class GitError(Exception):
    """A git call failed; the message says why."""


def repository(folder: Path) -> dict[str, Any]:
    """Return commit, dirty and diff of the repository that contains `folder`; unknown values are None.

    commit_problem is None, or says why something is unknown. Bytes of the diff that are not UTF-8 are written as
    escapes such as \\xf6.
    """
    found: dict[str, Any] = {"commit": None, "dirty": None, "diff": None, "commit_problem": None}
    try:
        found["commit"] = _answer(folder, ("rev-parse", "--verify", "HEAD")).decode().strip()
        found["dirty"] = bool(_answer(folder, STATUS).strip())
        found["diff"] = _diff(folder)
    except GitError as error:
        found["commit_problem"] = str(error)
    return found


def _answer(folder: Path, arguments: Sequence[str]) -> bytes:
    """Return git's output. Raises GitError if git fails or cannot be run."""
    try:
        done = subprocess.run(
            [*COMMAND, *arguments], cwd=folder, env=_environment(), stdin=subprocess.DEVNULL, capture_output=True,
            timeout=TIMEOUT_S,
        )  # fmt: skip
    except OSError as error:
        raise GitError(f"{error.filename}: {error.strerror}") from error
    except subprocess.TimeoutExpired as error:
        raise GitError(f"git {arguments[0]} took longer than {TIMEOUT_S:g} s") from error
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "backslashreplace").strip().splitlines()
        raise GitError(said[0].removeprefix("fatal: ") if said else f"git {arguments[0]} failed: {done.returncode}")
    return done.stdout


def _diff(folder: Path) -> str:
    """Return the diff to HEAD, cut at LARGEST_DIFF_BYTES: a diff can have any size and is never held as a whole."""
    with subprocess.Popen(
        [*COMMAND, *DIFF], cwd=folder, env=_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        watchdog = threading.Timer(TIMEOUT_S, process.kill)
        watchdog.start()
        try:
            content = process.stdout.read(LARGEST_DIFF_BYTES + 1)
            cut = len(content) > LARGEST_DIFF_BYTES
            if cut:
                process.kill()
            process.wait()
        finally:
            watchdog.cancel()
    if process.returncode != 0 and not cut:
        raise GitError("git diff failed, or took too long")
    text = content[:LARGEST_DIFF_BYTES].decode("utf-8", "backslashreplace")
    return text + "\n[the rest of the diff is left out]\n" if cut else text


def _environment() -> dict[str, str]:
    """Return the environment without variables that point git to another repository, such as GIT_DIR in git's hooks."""
    kept = {
        name: value
        for name, value in os.environ.items()
        # git's configuration stays, because it may list repositories of other users that the user trusts.
        if not name.startswith("GIT_") or (name.startswith("GIT_CONFIG_") and name != "GIT_CONFIG_PARAMETERS")
    }
    # No optional locks: `git status` would rewrite the index, perhaps while the user is running git.
    return {**kept, "GIT_OPTIONAL_LOCKS": "0", "GIT_TERMINAL_PROMPT": "0", "LC_ALL": "C"}

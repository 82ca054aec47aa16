"""How the rig starts a process of its own, and tells how one ended that said nothing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

CHILD_ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"),
    "ZENOH_RUNTIME": f"({', '.join(f'{pool}: (worker_threads: 1)' for pool in ('rx', 'tx', 'app', 'acc', 'net'))})",
}
"""Environment of the children: a 1 ms process wants no thread pool beside it"""


def log_of(directory: Path, role: str) -> Path:
    """Return where a process of the trial in `directory` writes what it prints."""
    return directory / "logs" / f"{role}.log"


def launch(directory: Path, role: str, orders: str, pass_fds: Sequence[int] = ()) -> subprocess.Popen[bytes]:
    """Start hilrig.rig.<role>_process with its orders; what it prints goes to its log in the trial's `directory`."""
    # -P: a folder of the working directory must not shadow a package. Its own session: Ctrl-C is the supervisor's.
    command = [sys.executable, "-P", "-m", f"hilrig.rig.{role}_process", orders]
    with log_of(directory, role).open("wb") as log:
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
            env={**os.environ, **CHILD_ENVIRONMENT}, pass_fds=pass_fds,
        )  # fmt: skip


def how_it_ended(directory: Path, role: str, code: int) -> str:
    """Return in words how a process ended that did not say so itself, with the last line that it printed."""
    log = log_of(directory, role)
    how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"
    lines = [line for line in log.read_text(errors="replace").splitlines() if line.strip()]
    last = f": {lines[-1].strip()}" if lines else ""
    return f"the {role} process {how}{last} (see {log})"

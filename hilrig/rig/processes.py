"""Child processes as the parent handles them: how they are started, watched and ended, and the last line of their logs.

Every wait has a limit. A process is ended in steps: by its own channel (an order on the bus, a message on its line),
then by SIGTERM, then by SIGKILL.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

CHILD_ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"),
    "ZENOH_RUNTIME": f"({', '.join(f'{pool}: (worker_threads: 1)' for pool in ('rx', 'tx', 'app', 'acc', 'net'))})",
}
"""Environment of the children: no thread pools beside a 1 ms loop"""
READY_TIMEOUT_S = float(os.environ.get("HILRIG_READY_TIMEOUT", "180"))
"""How long a process may take to get ready; the first trial on a machine compiles its kernels"""
SILENCE_TIMEOUT_S = float(os.environ.get("HILRIG_SILENCE_TIMEOUT", "15"))
"""How long a trial may go without progress before it counts as hung"""
TERM_TIMEOUT_S = 5.0
"""How long a process that was told to end may take before the next step"""
KILL_TIMEOUT_S = 5.0
"""How long to wait for a process after SIGKILL; after that it is left to the kernel"""
LOOK_S = 0.005
"""Time between two checks of a child"""
LONGEST_LOOK_S = 1.0
"""A longer time between two checks means that this process itself was suspended"""
LAST_BYTES = 65_536
"""How much of the end of a log is searched for the last line"""


def log_of(directory: Path, role: str) -> Path:
    """Return the file to which a process of the trial in `directory` prints."""
    return directory / "logs" / f"{role}.log"


def pause() -> bool:
    """Wait until the next check of a child is due; return False: nothing has happened that would end a wait."""
    time.sleep(LOOK_S)
    return False


class ChildProcess:
    """A child process. `name` is its name in messages: "the driver process"."""

    def __init__(self, name: str, process: subprocess.Popen[bytes]) -> None:
        self.name, self._process = name, process

    @classmethod
    def start(cls, name: str, module: str, orders: str, log: Path, pass_fds: Sequence[int] = ()) -> ChildProcess:
        """Start a hilrig module with `orders` as its argument; everything that it prints goes to `log`."""
        # -P: a folder in the working directory must not shadow a package. Own session: the parent handles Ctrl-C.
        command = [sys.executable, "-P", "-m", module, orders]
        with log.open("wb") as file:
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT, start_new_session=True,
                env={**os.environ, **CHILD_ENVIRONMENT}, pass_fds=pass_fds,
            )  # fmt: skip
        return cls(name, process)

    @property
    def exit_code(self) -> int | None:
        """Exit code of the process, -n if signal n ended it; None while it runs"""
        return self._process.poll()

    @property
    def failed(self) -> bool:
        """Whether the process has ended with an exit code other than 0"""
        return bool(self.exit_code)

    def wait(self, timeout_s: float, enough: Callable[[], bool] = pause) -> bool:
        """Wait for the process to end; return False if it still runs after `timeout_s`.

        `enough` is called between checks of the process. It does any work due meanwhile (by default it waits for
        `LOOK_S`), and ends the wait by returning True.
        """
        deadline = time.monotonic() + timeout_s
        while self.exit_code is None and not enough():
            if time.monotonic() > deadline:
                return False
        return True

    def terminate(self) -> None:
        """Send SIGTERM if the process is still running."""
        self._process.terminate()

    def kill(self, timeout_s: float = KILL_TIMEOUT_S) -> None:
        """Send SIGKILL if the process is still running, and wait for its end."""
        self._process.kill()
        self.wait(timeout_s)

    def end(self, timeout_s: float, term_timeout_s: float = TERM_TIMEOUT_S, enough: Callable[[], bool] = pause) -> None:
        """End the process: wait `timeout_s`, send SIGTERM, wait `term_timeout_s`, send SIGKILL.

        A caller that wants it to end before `timeout_s` must tell the process first. `enough` is as in `wait`: once it
        returns True, no further step is taken.
        """
        if self.wait(timeout_s, enough):
            return
        self.terminate()
        if not self.wait(term_timeout_s, enough):
            self.kill()

    def how_it_ended(self, log: Path | None = None) -> str:
        """Return one line on how the process ended, with the last line of its log: its last words."""
        code = self.exit_code
        if code is None:
            how = "is still running"
        elif code < 0:
            how = f"was killed by {_signal_name(-code)}"
        else:
            how = f"ended with exit code {code}"
        last = _last_line(log) if log is not None else ""
        return f"{self.name} {how}{': ' if last else ''}{last}"


def kill_all(children: Iterable[ChildProcess]) -> None:
    """Kill the children. All get SIGKILL before any is waited for: one may hold the core that another needs to exit."""
    children = tuple(children)
    for child in children:
        child.kill(timeout_s=0.0)
    for child in children:
        child.wait(KILL_TIMEOUT_S)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # most real-time signals have no name
        return f"signal {number}"


def _last_line(log: Path) -> str:
    """Return the last line of a log that is not blank, "" if there is none."""
    try:
        with log.open("rb") as file:
            file.seek(max(file.seek(0, os.SEEK_END) - LAST_BYTES, 0))
            text = file.read().decode(errors="replace")
    except OSError:
        return ""
    return next((line.strip() for line in reversed(text.splitlines()) if line.strip()), "")


class Stopwatch:
    """Measures how long a child has been silent, in the parent's own running time.

    A suspended parent (Ctrl-Z) receives nothing meanwhile, and its children are not to blame: at most `LONGEST_LOOK_S`
    of the time between two checks counts.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Begin at zero again."""
        self._elapsed_s, self._looked = 0.0, time.monotonic()

    def look(self) -> float:
        """Return the time since the last restart, s. Must be called more often than every `LONGEST_LOOK_S`."""
        now = time.monotonic()
        self._elapsed_s += min(now - self._looked, LONGEST_LOOK_S)
        self._looked = now
        return self._elapsed_s

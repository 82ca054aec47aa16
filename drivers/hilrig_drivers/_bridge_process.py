"""The process of a bridge, as the driver that starts it sees it: its command line, its folder and what it prints."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from hilrig import HilrigError
from hilrig_drivers import bridge

SOCKET, LOG = "bridge.sock", "bridge.log"


@dataclass(frozen=True)
class BridgeSettings:
    """What a bridge is started with. One that has other settings is ended, and another one started."""

    robot_file: str
    """The file with the class `Robot`"""
    python: str = sys.executable
    """The interpreter that has the robot's software"""
    settings: Mapping[str, str] = field(default_factory=dict)
    """Arguments of `Robot`"""
    order_age: float = 0.1
    """s; without an order for so long the bridge holds the robot"""
    sample_age: float = 0.1
    """s; the same without a sample"""
    at: str = ""
    """HOST:PORT of a bridge that somebody has started; empty: the run's own, which is started when there is none"""
    start_time: float = 15.0
    """Longest time until a bridge that is started answers with a sample, s"""


class BridgeProcess:
    """The bridge of the program that runs the trials. It may have been started in an earlier trial."""

    def __init__(self, settings: BridgeSettings) -> None:
        self._settings = settings
        program = _program()
        # Only the user may enter it. The name is short, because it holds sockets.
        self.folder = Path(tempfile.gettempdir()) / f"hilrig-bridge-{program}-{bridge.birth(program)}"
        self.at = str(self.folder / SOCKET)
        """Path of its socket"""
        ages = ["--order-age", str(settings.order_age), "--sample-age", str(settings.sample_age)]
        sets = [word for name, value in settings.settings.items() for word in ("--set", f"{name}={value}")]
        self._words = [settings.robot_file, "--at", self.at, "--owner", str(program), *ages, *sets]
        self.setup = zlib.crc32("\0".join(self._words).encode())
        """Checksum of its command line"""
        self._process: subprocess.Popen[bytes] | None = None
        self._log: BinaryIO | None = None

    def start(self) -> None:
        """Start it in a session of its own: it outlives this process. Raises HilrigError if that is not possible."""
        self.folder.mkdir(mode=0o700, exist_ok=True)
        with suppress(FileNotFoundError):
            os.unlink(self.at)  # of one that was killed
        python = self._settings.python
        try:
            with (self.folder / LOG).open("wb") as log:
                self.open_log()
                self._process = subprocess.Popen(
                    [python, bridge.__file__, *self._words],
                    stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True,
                )  # fmt: skip
        except OSError as error:
            self.remove()
            raise HilrigError(f"the bridge cannot be started with {python}: {error.strerror}") from None

    def why_ended(self) -> str:
        """Return why the bridge that was started has ended; empty if it has not."""
        if self._process is None or self._process.poll() is None:
            return ""
        lines = [line for line in self.show_log().splitlines() if line.strip()]
        return (
            f"the bridge ended with exit code {self._process.returncode}: {lines[-1] if lines else 'it said nothing'} "
            f"(started with {self._settings.python} for {self._settings.robot_file})"
        )

    def open_log(self, whence: int = os.SEEK_SET) -> None:
        """Open what the bridge prints, at its beginning or its end. The bridge removes the file when it ends."""
        with suppress(OSError):
            self._log = self._log or (self.folder / LOG).open("rb")
            self._log.seek(0, whence)

    def show_log(self) -> str:
        """Print what the bridge has printed in this trial, which makes it a part of the trial's log; return it."""
        text = self._log.read().decode(errors="replace") if self._log else ""
        print(text, end="", flush=True)
        return text

    def remove(self) -> None:
        """Remove what a bridge that was killed has left."""
        shutil.rmtree(self.folder, ignore_errors=True)


def _program() -> int:
    """Return the process id of the program that runs the trials; this one, where there is no other."""
    return int(os.environ.get("HILRIG_PROGRAM", os.getpid()))

"""One trial of the real program: `hilrig run` in a separate process, and its timing from its files."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.exchange import Sizes
from hilrig.core.errors import RigError
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.recording.messages.layouts import layouts
from hilrig.recording.run_directory import read_json

EXPERIMENT = Path(__file__).with_name("two_link.yaml")
DURATION = "phases.0.duration"
PATHS = os.pathsep.join(filter(None, [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH")]))
"""Where the processes of a trial find `benchmarks`, whatever their working directory"""

PATIENCE = 240.0
"""s beyond the trial's own time; the first one on a machine compiles its kernels"""
PYTHON = (sys.executable, "-P", "-m")
TIMES = ("lateness", "round_trip", "compute", "command_age")


@dataclass(frozen=True)
class TrialCall:
    """How one trial is run."""

    duration: float
    """s of trial time"""
    arguments: tuple[str, ...] = ()
    """Of `hilrig run`"""
    prefix: tuple[str, ...] = ()
    """Command that starts it"""
    watched: bool = False
    """With `hilrig watch` attached"""
    program: str = "hilrig"
    """Module that is run"""


def run_trial(call: TrialCall, look: Callable[[Path], None] = lambda trial: None) -> dict[str, float]:
    """Run the trial; return its rate and its timing, see `quantities`. Raises RigError if it did not complete.

    `look` receives the trial's folder, which is deleted afterwards.
    """
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        folder = Path(name)
        command = [
            *call.prefix, *PYTHON, call.program, "run", str(EXPERIMENT), "--no-report", "--out", str(folder / "runs"),
            "--set", f"{DURATION}={call.duration:g}", *call.arguments,
        ]  # fmt: skip
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            cwd=folder, env={**os.environ, "PYTHONPATH": PATHS},
        )  # fmt: skip
        try:
            with _watch(folder / "runs") if call.watched else nullcontext():
                complaint = process.communicate(timeout=PATIENCE + call.duration)[1]
        except subprocess.TimeoutExpired:
            raise RigError(f"the trial did not end within {PATIENCE + call.duration:.0f} s") from None
        finally:
            _end(process)
        return _read(folder / "runs", complaint, look)


def payload_sizes() -> Sizes:
    """Return the size of the State and of the Command that the benchmark's experiment puts on the bus, in bytes."""
    (trial,) = plan(load(EXPERIMENT, []))
    codecs = layouts(trial.driver.robot.joints, len(trial.axes), {})
    return Sizes(codecs["state"].size, codecs["command"].size)


def _read(runs: Path, complaint: str, look: Callable[[Path], None]) -> dict[str, float]:
    trials = sorted(runs.glob("*/trials/*"))
    if not trials:
        lines = complaint.strip().splitlines()
        raise RigError(f"hilrig run made no trial: {lines[-1] if lines else 'it printed nothing'}")
    outcome = read_json(trials[0] / "outcome.json")
    if outcome["outcome"] != "completed":
        raise RigError(f"the trial ended {outcome['outcome']}: {outcome['reason']}")
    look(trials[0])
    return quantities(outcome, read_json(trials[0] / "timing.json"))


def quantities(outcome: Mapping[str, Any], timing: Mapping[str, Any]) -> dict[str, float]:
    """Return a completed trial's ticks, steps_per_s, loop_steps_per_s, late, late_fraction, and <what>_p50_us, _p99_us,
    _max_us of `TIMES`.

    steps_per_s excludes the start-up; loop_steps_per_s is from the first tick to the last, without the writing
    afterwards. Quantities that the trial did not measure are left out.
    """
    ticks = outcome["ticks"]
    found = {"ticks": float(ticks)}
    if outcome["wall_s"]:
        found["steps_per_s"] = ticks / outcome["wall_s"]
    if outcome.get("loop_s"):
        found["loop_steps_per_s"] = ticks / outcome["loop_s"]
    if timing.get("ticks"):
        found |= {"late": float(timing["late"]), "late_fraction": float(timing["late_fraction"])}
    for name in TIMES:
        table = timing.get(f"{name}_us") or {}
        found |= {f"{name}_{quantile}_us": table[quantile] for quantile in ("p50", "p99", "max") if quantile in table}
    return found


def _end(process: subprocess.Popen[Any]) -> None:
    """End a process that is still running; the processes of its trial end with it."""
    if process.poll() is None:
        process.terminate()
        try:
            process.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@contextmanager
def _watch(runs: Path) -> Iterator[None]:
    """Attach `hilrig watch`, on its own terminal, to the run that starts below `runs`."""
    deadline = time.monotonic() + PATIENCE
    while not (started := list(runs.glob("*/trials"))):
        if time.monotonic() > deadline:
            raise RigError("no run started that could be watched")
        time.sleep(0.05)
    screen, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", "LINES": "30"}
    watcher = subprocess.Popen(
        [*PYTHON, "hilrig", "watch", str(started[0].parent)],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        env=environment,
    )
    os.close(terminal)
    reader = threading.Thread(target=_drain, args=(screen,), daemon=True)
    reader.start()
    try:
        yield
    finally:
        _end(watcher)
        reader.join(timeout=5.0)
        os.close(screen)


def _drain(screen: int) -> None:
    """Read the output until the other end closes."""
    try:
        while os.read(screen, 65536):
            pass
    except OSError:
        return

"""One trial of the real program: `hilrig run` in a process of its own, and what its files say of its timing."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from benchmarks.exchange import Sizes
from hilrig.core.errors import RigError
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.recording.messages.codec import Codec, definition
from hilrig.recording.run_directory import read_json

PATIENCE = 240.0
"""s beyond the trial's own time; the first one on a machine compiles its kernels"""
HILRIG = (sys.executable, "-P", "-m", "hilrig")
WRENCH = 6
"""Force and moment"""
TOLD = ("lateness", "round_trip", "compute", "command_age")


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


def run_trial(call: TrialCall, look: Callable[[Path], None] = lambda trial: None) -> dict[str, float]:
    """Run the trial; return its rate and its timing, see `quantities`. Raises RigError if it did not complete.

    `look` is given the trial's folder, which is gone afterwards.
    """
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        folder = Path(name)
        experiment = write_experiment(folder, call.duration)
        command = [*call.prefix, *HILRIG, "run", str(experiment), "--no-report", "--out", str(folder / "runs")]
        process = subprocess.Popen(
            [*command, *call.arguments], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, cwd=folder,
        )  # fmt: skip
        try:
            with _watch(folder / "runs") if call.watched else _nobody():
                complaint = process.communicate(timeout=PATIENCE + call.duration)[1]
        except subprocess.TimeoutExpired:
            raise RigError(f"the trial did not end within {PATIENCE + call.duration:.0f} s") from None
        finally:
            _end(process)
        return _read(folder / "runs", complaint, look)


def write_experiment(folder: Path, duration: float) -> Path:
    """Write the benchmark's experiment, `duration` seconds long, into `folder`; return the file."""
    text = resources.files("benchmarks").joinpath("two_link.yaml").read_text(encoding="utf-8")
    path = folder / "bench.yaml"
    path.write_text(text.replace("DURATION", f"{duration:g}"), encoding="utf-8")
    return path


def payload_sizes() -> Sizes:
    """Return the size of the State and of the Command that the benchmark's experiment puts on the bus, in bytes."""
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        (trial,) = plan(load(write_experiment(Path(name), 1.0), []))
    joints = trial.driver.robot.joints
    sizes = {"wrench": WRENCH}

    def size(message: str) -> int:
        wanted = definition(message)
        return Codec(wanted, {field.name: sizes.get(field.name, joints) for field in wanted.fields}).size

    return Sizes(size("State"), size("Command"))


def _read(runs: Path, complaint: str, look: Callable[[Path], None]) -> dict[str, float]:
    trials = sorted(runs.glob("*/trials/*"))
    if not trials:
        lines = complaint.strip().splitlines()
        raise RigError(f"hilrig run made no trial: {lines[-1] if lines else 'it said nothing'}")
    outcome = read_json(trials[0] / "outcome.json")
    if outcome["outcome"] != "completed":
        raise RigError(f"the trial is {outcome['outcome']}: {outcome['reason']}")
    look(trials[0])
    return quantities(outcome, read_json(trials[0] / "timing.json"))


def quantities(outcome: Mapping[str, Any], timing: Mapping[str, Any]) -> dict[str, float]:
    """Return what a completed trial tells: steps_per_s, late, late_fraction, and <what>_p50_us, _p99_us, _max_us.

    steps_per_s leaves the start-up out; loop_steps_per_s is from the first tick to the last, without what is written
    after that. What the trial did not measure is left out.
    """
    ticks = outcome["ticks"]
    found = {"ticks": float(ticks)}
    if outcome["wall_s"]:
        found["steps_per_s"] = ticks / outcome["wall_s"]
    if outcome.get("loop_s"):
        found["loop_steps_per_s"] = ticks / outcome["loop_s"]
    if timing.get("ticks"):
        found |= {"late": float(timing["late"]), "late_fraction": float(timing["late_fraction"])}
    for name in TOLD:
        table = timing.get(f"{name}_us") or {}
        found |= {f"{name}_{quantile}_us": table[quantile] for quantile in ("p50", "p99", "max") if quantile in table}
    return found


@cache
def has_watch() -> bool:
    """Whether this hilrig has the verb `watch`."""
    return _succeeds([*HILRIG, "watch", "--help"])


def _succeeds(command: Sequence[str]) -> bool:
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE).returncode == 0


def _end(process: subprocess.Popen[Any]) -> None:
    """End a process that is still running; the children of a trial end with it."""
    if process.poll() is None:
        process.terminate()
        try:
            process.communicate(timeout=10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@contextmanager
def _nobody() -> Iterator[None]:
    yield


@contextmanager
def _watch(runs: Path) -> Iterator[None]:
    """Attach `hilrig watch`, on a terminal of its own, to the run that begins below `runs`."""
    deadline = time.monotonic() + PATIENCE
    while not (begun := list(runs.glob("*/trials"))):
        if time.monotonic() > deadline:
            raise RigError("no run to watch began")
        time.sleep(0.05)
    screen, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", "LINES": "30"}
    watcher = subprocess.Popen(
        [*HILRIG, "watch", str(begun[0].parent)], stdin=terminal, stdout=terminal, stderr=terminal, env=environment
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
    """Read what is shown until the other end is closed."""
    try:
        while os.read(screen, 65536):
            pass
    except OSError:
        return

"""Runs trials in which something fails, and reads from the driver's own record how fast the plant was held."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hilrig.cli.progress import Display
from hilrig.core.errors import RigError
from hilrig.experiment import Experiment, load
from hilrig.experiment.plan import plan
from hilrig.experiment.plan.assessing import assess
from hilrig.recording.run_directory import read_driver_record, trial_path
from hilrig.rig.execution import Options, execute

EXPERIMENT = Path(__file__).with_name("experiment.yaml")
ORPHANED = "controllers={orphaned: {kind: ./failing_law.py, way: orphaned}}"
"""The program is killed: each of these trials needs one of its own"""
ALONE_S = 30.0
"""How long the processes of a trial may take to end after their program was killed"""


class Held(NamedTuple):
    """How fast the plant was held where something failed in one way."""

    way: str
    trials: int
    within: int
    """Trials in which it was held within the command age plus a period"""
    p50: float
    """s, of the age of the command in effect"""
    p99: float
    longest: float


def measure_holds(trials: int, out: Path) -> dict[str, Any]:
    """Run at least this many trials, all ways alike often; return what was found, and the run's directory.

    Raises RigError if a trial's plant was not held by its driver at all.
    """
    repeats = math.ceil(trials / (len(load(EXPERIMENT).controllers) + 1))
    loaded = load(EXPERIMENT, [f"repeats={repeats}"])
    limit = plan(loaded)[0].limits.command_age_limit(loaded.period, loaded.actuation_delay) + loaded.period
    ages: dict[str, list[float]] = {}
    for way, folder in (*_run(loaded, trials, out), *_run_orphaned(repeats, out)):
        ages.setdefault(way, []).append(_age(folder))
    found = [_held(way, np.array(values), limit) for way, values in ages.items()]
    return {"limit_s": limit, "held": [row._asdict() for row in found], "run": str(out)}


def _run(loaded: Experiment, trials: int, out: Path) -> Iterator[tuple[str, Path]]:
    """Run all trials of the experiment; yield how each failed, and its directory."""
    planned = plan(loaded)
    command = ["python", "-m", "benchmarks", "holds", f"--trials={trials}"]
    with Display(len(planned)) as display:
        run, _ = execute(loaded, planned, assess(loaded, planned), EXPERIMENT, Options(out, command), display)
    for trial in planned:
        yield trial.controller_name, trial_path(run, trial.id)


def _run_orphaned(trials: int, out: Path) -> Iterator[tuple[str, Path]]:
    """Run trials whose program is killed, each with a program of its own."""
    for i in range(trials):
        runs = out / f"orphaned-{i}"
        command = [sys.executable, "-m", "hilrig", "run", str(EXPERIMENT), "--set", ORPHANED, "--no-report"]
        subprocess.run([*command, "--out", str(runs)], check=False, capture_output=True, timeout=600)
        (folder,) = runs.glob("*/trials/*")
        deadline = time.monotonic() + ALONE_S
        while not read_driver_record(folder) and time.monotonic() < deadline:
            time.sleep(0.05)
        yield "orphaned", folder


def _age(folder: Path) -> float:
    """Return how old the command in effect was when the plant of a trial was held, s."""
    record = read_driver_record(folder)
    age = record.get("held_command_age_s")
    if age is None:
        raise RigError(f"{folder}: its plant was not held: {record or 'its driver left no record'}")
    return age


def _held(way: str, ages: np.ndarray, limit: float) -> Held:
    p50, p99 = np.quantile(ages, [0.5, 0.99])
    return Held(way, ages.size, int((ages <= limit).sum()), float(p50), float(p99), float(ages.max()))


def render(result: dict[str, Any]) -> str:
    """Return the result as text."""
    rows = [
        f"{row['way']:<10}{row['trials']:>8}{row['within']:>10}"
        + "".join(f"{1e3 * row[name]:>10.2f}" for name in ("p50", "p99", "longest"))
        for row in result["held"]
    ]
    limit = 1e3 * result["limit_s"]
    return "\n".join([
        f"age of the command in effect when the plant was held, in ms; the limit is {limit:g} ms",
        f"{'failure':<10}{'trials':>8}{'within':>10}{'p50':>10}{'p99':>10}{'max':>10}",
        *rows,
    ])  # fmt: skip

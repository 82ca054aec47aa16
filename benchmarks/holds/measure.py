"""Runs trials whose controllers fail, and reads from the driver's own record how fast the plant was held."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hilrig.cli.progress import Display
from hilrig.core.errors import RigError
from hilrig.experiment import load
from hilrig.experiment.plan import plan
from hilrig.experiment.plan.assessing import assess
from hilrig.recording.run_directory import read_outcome
from hilrig.rig.execution import Options, execute

EXPERIMENT = Path(__file__).with_name("experiment.yaml")


class Held(NamedTuple):
    """How fast the plant was held where the controller failed in one way."""

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
    ways = len(load(EXPERIMENT).controllers)
    loaded = load(EXPERIMENT, [f"repeats={math.ceil(trials / ways)}"])
    planned = plan(loaded)
    command = ["python", "-m", "benchmarks", "holds", f"--trials={trials}"]
    with Display(len(planned)) as display:
        run, _ = execute(loaded, planned, assess(loaded, planned), EXPERIMENT, Options(out, command), display)
    limit = planned[0].limits.command_age_limit(loaded.period, loaded.actuation_delay) + loaded.period
    ages: dict[str, list[float]] = {}
    for trial in planned:
        outcome = read_outcome(run, trial.id)
        age = outcome.get("held_command_age_s")
        if age is None:
            raise RigError(f"{trial.id}: its plant was not held: {outcome['outcome']}, {outcome['reason']}")
        ages.setdefault(trial.controller_name, []).append(age)
    found = [_held(way, np.array(values), limit) for way, values in ages.items()]
    return {"limit_s": limit, "held": [row._asdict() for row in found], "run": str(run)}


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
        f"{'controller':<10}{'trials':>8}{'within':>10}{'p50':>10}{'p99':>10}{'max':>10}",
        *rows,
    ])  # fmt: skip

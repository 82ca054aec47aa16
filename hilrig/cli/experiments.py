"""Shared by the verbs that take an experiment: its trials, its warnings, and Ctrl-C."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from hilrig.core.errors import Problem
    from hilrig.experiment import Experiment
    from hilrig.experiment.plan.assessing import PlanAssessment
    from hilrig.experiment.trial import Trial


def planned(path: Path, overrides: list[str]) -> tuple[Experiment, tuple[Trial, ...]]:
    """Return the experiment in the file, with overrides, and its trials. Raises ExperimentError."""
    from hilrig.experiment import load
    from hilrig.experiment.plan import plan as plan_trials

    loaded = load(path, overrides)
    return loaded, plan_trials(loaded)


def judged(experiment: Experiment, trials: tuple[Trial, ...]) -> tuple[PlanAssessment, list[Problem]]:
    """Return the assessment of the bounds, and the resulting warnings."""
    from hilrig.experiment.plan.assessing import assess
    from hilrig.experiment.plan.warnings import warnings

    found = assess(experiment, trials)
    return found, warnings(experiment, found)


def echo_warnings(warnings: list[Problem]) -> None:
    """Print warnings on stderr, one per line."""
    for warning in warnings:
        typer.echo(str(warning._replace(message=f"warning: {warning.message}")), err=True)


def interruptible() -> threading.Event:
    """Return an event that is set by Ctrl-C or SIGTERM. A second signal ends the program at once."""
    stop = threading.Event()

    def interrupt(_number: int, _frame: Any) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        stop.set()

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    return stop

"""Shared by the verbs that take an experiment: its trials, its warnings, and Ctrl-C."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
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


class Interruption(threading.Event):
    """Set by the first Ctrl-C or SIGTERM. A second one ends the program at once, but not while trials are ending."""

    def __init__(self) -> None:
        super().__init__()
        self._running = False

    @contextmanager
    def trials(self) -> Iterator[None]:
        """Run trials in the body: they end by themselves once this is set, and every wait in them has a limit."""
        self._running = True
        try:
            yield
        finally:
            self._running = False

    def note(self, _number: int, _frame: Any) -> None:
        """Handle a signal. Raises KeyboardInterrupt at the second one, outside of `trials`."""
        if not self.is_set():
            self.set()
        elif self._running:
            os.write(2, STILL_ENDING)
        else:
            raise KeyboardInterrupt


STILL_ENDING = (
    b"hilrig: ending the trial; the plant is held first, then the record is written, which may take a minute\n"
)


def interruptible() -> Interruption:
    """Return an event that is set by Ctrl-C or SIGTERM."""
    stop = Interruption()
    signal.signal(signal.SIGINT, stop.note)
    signal.signal(signal.SIGTERM, stop.note)
    return stop

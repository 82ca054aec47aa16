"""The plan's data on the watched trials, from its documents alone: no plug-in is loaded."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hilrig.experiment.timing_budget import TimingBudget
from hilrig.recording.run_directory import read_json, read_manifest, read_plan, trial_path


@dataclass(frozen=True)
class PlannedTrial:
    """A trial of the plan."""

    id: str
    number: int
    """From 1, in the order of the plan"""
    name: str
    """Controller, condition and repeat, for display"""
    axes: tuple[str, ...]
    force_axes: tuple[str, ...]
    period: float
    ticks: int
    realtime: bool
    phases: tuple[tuple[str, float], ...]
    """Name and end (s) of each"""
    late_fraction: float
    """Fraction of late ticks that the experiment allows"""

    def phase_at(self, time: float) -> str:
        """Return the name of the phase at trial time `time`, s."""
        return next((name for name, end in self.phases if time < end), self.phases[-1][0])


@dataclass(frozen=True)
class PlannedRun:
    """A run and its trials."""

    path: Path
    name: str
    question: str
    trials: Mapping[str, PlannedTrial]

    def ended(self) -> Counter[str]:
        """Return how many trials have ended so far, by outcome."""
        files = [trial_path(self.path, trial) / "outcome.json" for trial in self.trials]
        return Counter(read_json(file)["outcome"] for file in files if file.is_file())


def planned_run(path: Path) -> PlannedRun:
    """Return the run in a run directory. Raises RunDirectoryError."""
    manifest, documents = read_manifest(path), read_plan(path)["trials"]
    trials = [planned_trial(document, number) for number, document in enumerate(documents, start=1)]
    return PlannedRun(path, manifest["name"], manifest["question"], {trial.id: trial for trial in trials})


def planned_trial(document: Mapping[str, Any], number: int) -> PlannedTrial:
    """Return the trial that plan.json describes by `document`."""
    phases = tuple((phase["name"], phase["end"]) for phase in document["phases"])
    return PlannedTrial(
        document["id"],
        number,
        f"{document['controller_name']}, {document['condition_name']}, repeat {document['repeat']}",
        tuple(document["axes"]),
        tuple(document["task"]["force_axes"]),
        document["period"],
        round(phases[-1][1] / document["period"]),
        document["clock"] == "realtime",
        phases,
        TimingBudget(**document.get("timing", {})).late_fraction,
    )

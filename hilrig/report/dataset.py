"""Reads a run directory: its documents, and the signals of one trial at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from hilrig.core.signals import WRENCH_AXES, Array
from hilrig.experiment.expecting import ends_as_expected
from hilrig.experiment.trial import TaskSpec, make_impedance
from hilrig.kinds.metrics._record import PhaseRecord
from hilrig.recording.bag import read_bag
from hilrig.recording.certificate.durations import late_ticks
from hilrig.recording.certificate.table import StampTable, join
from hilrig.recording.messages.codec import definition
from hilrig.recording.run_directory import (
    ending,
    find_run,
    read_json,
    read_manifest,
    read_outcome,
    read_plan,
    trial_path,
)
from hilrig.recording.timing import terms_of

SIGNAL_CHANNELS = ("truth", "command", "applied", "internals", "driver_timing", "controller_timing")
"""The channels that a report needs; if the driver does not know the truth, the state is used instead"""

JsonDocument = Mapping[str, Any]
Channels = dict[str, dict[str, np.ndarray]]


@dataclass(frozen=True)
class TrialEntry:
    """One planned trial: its document in plan.json, and how it ended according to the rig."""

    folder: Path
    document: JsonDocument
    outcome: JsonDocument
    """As `read_outcome` returns it"""
    timing: JsonDocument
    """Content of timing.json; empty if there is none"""

    @property
    def id(self) -> str:
        """<controller>.<condition>.<repeat>"""
        return self.document["id"]

    @property
    def controller(self) -> str:
        """Name of the controller"""
        return self.document["controller_name"]

    @property
    def condition(self) -> str:
        """Name of the condition"""
        return self.document["condition_name"]

    @property
    def repeat(self) -> int:
        """Number of the repeat, from 0"""
        return self.document["repeat"]

    @property
    def completed(self) -> bool:
        """Whether the trial ran to its end and its record is complete"""
        return self.outcome["outcome"] == "completed"

    @property
    def ending(self) -> str:
        """How the trial ended; "invalid" if it ran outside its timing budget"""
        return ending(self.outcome)

    @property
    def counts(self) -> bool:
        """Whether the trial is compared: it completed within its timing budget"""
        return self.ending == "completed"


@dataclass(frozen=True)
class RunData:
    """The documents of a run directory; the bags stay on disk."""

    path: Path
    experiment: JsonDocument
    manifest: JsonDocument
    trials: tuple[TrialEntry, ...]
    experiment_text: str
    bounds: JsonDocument
    """The bounds that the plan keeps, by controller and for the task; empty in older plans without bounds"""

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, in the order of the plan."""
        return tuple(dict.fromkeys(trial.controller for trial in self.trials))

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions, in the order of the plan."""
        return tuple(dict.fromkeys(trial.condition for trial in self.trials))

    def as_expected(self, trial: TrialEntry) -> bool:
        """Return whether the experiment expects this trial to end as it did."""
        expect = self.experiment.get("expect") or ()
        return ends_as_expected(expect, trial.controller, trial.condition, trial.ending)


@dataclass(frozen=True)
class TrialSignals:
    """The signals of one trial at the ticks that all channels have, with a new sample: N ticks, m axes, n joints."""

    record: PhaseRecord
    """The whole trial"""
    internals: dict[str, Array]
    """The fields that the control law published, by name, (N, k) each"""
    source: str
    """Source of position, velocity and force: "truth" or "measurement" """


def load_run(path: Path) -> RunData:
    """Read a run's documents. Raises RunDirectoryError if `path` is not a run."""
    plan = read_plan(find_run(path))
    return RunData(
        path,
        plan["experiment"],
        read_manifest(path),
        tuple(_entry(path, document) for document in plan["trials"]),
        (path / "experiment.yaml").read_text(encoding="utf-8", errors="replace"),
        plan.get("bounds", {}),
    )


def _entry(path: Path, document: JsonDocument) -> TrialEntry:
    folder = trial_path(path, document["id"])
    timing = folder / "timing.json"
    outcome = read_outcome(path, document["id"])
    return TrialEntry(folder, document, outcome, read_json(timing) if timing.exists() else {})


def read_signals(trial: TrialEntry) -> TrialSignals | None:
    """Return the signals in one trial's bag; None if there is no bag, or if it has fewer than 2 ticks."""
    return align(read_channels(trial), trial.document)


def read_channels(trial: TrialEntry) -> Channels:
    """Return the channels that a report needs from one trial's bag; empty if there is no bag."""
    bag = trial.folder / "bag.mcap"
    channels = read_bag(bag, SIGNAL_CHANNELS) if bag.exists() else {}
    return channels if "truth" in channels or not channels else {**channels, **read_bag(bag, ("state",))}


def align(channels: Channels, document: JsonDocument) -> TrialSignals | None:
    """Return a bag's channels, named as in the metrics; None for fewer than 2 ticks.

    The ticks are those that all channels have, and at which the plant's sample was new.
    """
    plant = "truth" if "truth" in channels else "state"
    needed = [name for name in (plant, "command", "internals") if name in channels]
    if len(needed) < 3:
        return None
    ticks = reduce(np.intersect1d, [channels[name]["tick"] for name in needed])
    ticks = np.intersect1d(ticks, _sampled(channels[plant]))
    if ticks.size < 2:
        return None
    picked = {name: _pick(channels[name], ticks) for name in needed}
    axes = tuple(document["axes"])
    source = picked.get("truth", picked["internals"])
    wrench = picked[plant]["wrench"]
    record = _record(picked, source, wrench, axes, document, _late(channels, document, ticks))
    return TrialSignals(record, _memory(picked["internals"]), "truth" if "truth" in picked else "measurement")


def _sampled(plant: dict[str, np.ndarray]) -> np.ndarray:
    """Return the ticks at which there was a new sample: what a repeated one says is of the tick before."""
    return plant["tick"][plant["fresh"] != 0] if "fresh" in plant else plant["tick"]


def _pick(channel: dict[str, np.ndarray], ticks: np.ndarray) -> dict[str, np.ndarray]:
    """Return the rows of a channel at `ticks`; it must have all of them."""
    if channel["tick"].size == ticks.size:
        return channel
    rows = np.searchsorted(channel["tick"], ticks)
    return {name: values[rows] for name, values in channel.items()}


def timing_table(channels: Channels, one_clock: bool = True) -> StampTable | None:
    """Return the time stamps of a trial by tick; None if its bag has none, as for a compiled trial."""
    driver = channels.get("driver_timing")
    return None if driver is None else join(driver, channels.get("controller_timing"), one_clock)


def _late(channels: Channels, document: JsonDocument, ticks: np.ndarray) -> Array:
    """Return how many ticks were late, by the driver's stamps, since the previous entry of `ticks`, (N,)."""
    table = timing_table(channels)
    if table is None:
        return np.zeros(ticks.size)
    late = table.driver.tick[late_ticks(table, terms_of(document))]
    rows = np.searchsorted(ticks, late[late <= ticks[-1]])
    return np.bincount(rows, minlength=ticks.size).astype(np.float64)


_STANDARD = frozenset(field.name for field in definition("Internals").fields)


def _memory(internals: dict[str, np.ndarray]) -> dict[str, Array]:
    """Return the fields of the law's own memory among the internals, (N, k) each."""
    own = {name: values for name, values in internals.items() if name not in _STANDARD}
    return {name: values.reshape(values.shape[0], -1) for name, values in own.items()}


def _record(
    picked: Channels,
    source: dict[str, np.ndarray],
    wrench: np.ndarray,
    axes: tuple[str, ...],
    document: JsonDocument,
    late: Array,
) -> PhaseRecord:
    internals, time = picked["internals"], picked["command"]["time"]
    velocity = source["velocity"]
    impedance = make_impedance(TaskSpec.from_document(document["task"]), axes)
    desired = internals["reference_position"]
    return PhaseRecord(
        tick=picked["command"]["tick"],
        time=time,
        phases=len(document["phases"]),
        period=document["period"],
        axes=axes,
        sigma=impedance.sigma,
        inertia=impedance.inertia,
        damping=impedance.damping,
        stiffness=impedance.stiffness,
        position=source["position"],
        velocity=velocity,
        acceleration=np.gradient(velocity, time, axis=0),
        force=wrench[:, [WRENCH_AXES.index(axis) for axis in axes]],
        reference_position=desired,
        reference_velocity=internals["reference_velocity"],
        reference_acceleration=internals["reference_acceleration"],
        reference_force=internals["reference_force"],
        reference_step=desired[0] - source["position"][0],
        torque=picked["command"]["torque"],
        late=late,
    )

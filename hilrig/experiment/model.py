"""The contents of an experiment file as frozen dataclasses, which hilrig.experiment.schema fills from the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, Literal

from hilrig.core.errors import Place
from hilrig.core.interfaces import Controller, Disturbance, Driver, ReferenceSignal
from hilrig.core.parameters import Parameter, PerAxis
from hilrig.experiment.document import Document
from hilrig.experiment.limits import Limits
from hilrig.experiment.rig_settings import RigSettings
from hilrig.experiment.schema import ByAxis, Later
from hilrig.experiment.timing_budget import TimingBudget
from hilrig.kinds import registry as plugins


@dataclass(frozen=True)
class ImpedanceSpec:
    """The desired dynamics, eq. (3) of the paper; each value once for all axes, or once per axis."""

    inertia: Annotated[PerAxis, Parameter("kg", "M_d", 1e-6, 1e6, "log")]
    damping: Annotated[PerAxis, Parameter("N*s/m", "B_d", 0.0, 1e6, "log")]
    stiffness: Annotated[PerAxis, Parameter("N/m", "K_d; unused in force-controlled axes", 0.0, 1e7, "log")]
    states: Annotated[Literal["measured", "reference"], Parameter("", "states the filter runs on")] = "measured"
    anti_windup: Annotated[
        Literal["clip", "none"], Parameter("", "whether the filter's p_d, v_d are kept near the measured state")
    ] = "clip"


@dataclass(frozen=True)
class TaskSection:
    """What is controlled along each axis, and with which desired dynamics."""

    force_axes: Annotated[tuple[str, ...], Parameter("", "force-controlled axes; the others are position-controlled")]
    impedance: Annotated[ImpedanceSpec, Parameter("", "the desired dynamics")]
    velocity_cutoff: Annotated[
        float, Parameter("Hz", "cut-off frequency of the joint velocity filter", 1e-2, 1e5, "log")
    ] = 100.0
    start: Annotated[Mapping[str, float], Parameter("m", "where the tip starts, by axis")] = field(default_factory=dict)
    on_stale_sample: Annotated[
        Literal["hold", "call"],
        Parameter("", "where a sample is not new: the last command is held, or the law is called all the same"),
    ] = "hold"


@dataclass(frozen=True)
class Phase:
    """A span of the experiment with its references."""

    name: Annotated[str, Parameter("", "name of the phase")]
    duration: Annotated[float, Parameter("s", "how long it lasts, a whole number of periods", 1e-4, 1e5)]
    position: Annotated[
        Mapping[str, ReferenceSignal], ByAxis("m"), Parameter("", "x_d: one reference, or one per axis")
    ] = field(default_factory=dict)
    force: Annotated[
        Mapping[str, ReferenceSignal], ByAxis("N"), Parameter("", "F_d: one reference, or one per axis")
    ] = field(default_factory=dict)


@dataclass(frozen=True)
class Expectation:
    """A limit on a controller's metric, or on its difference from that of another (`minus`); or how its trials end.

    The metric keeps the limit if it does so in every repeat. The difference keeps it if the 95 % interval of the mean
    paired difference does; repeat i of one controller is paired with repeat i of the other. An outcome is met if every
    trial of the controller ends that way. Exactly one of `metric` and `outcome` is given.
    """

    controller: Annotated[str, Parameter("", "name of the controller")]
    metric: Annotated[str | None, Parameter("", "kind of the metric")] = None
    outcome: Annotated[
        Literal["completed", "tripped"] | None, Parameter("", "how every trial ends, instead of a metric")
    ] = None
    minus: Annotated[str | None, Parameter("", "controller whose metric is subtracted; default: none")] = None
    phase: Annotated[str | None, Parameter("", "name of a phase; default: 'all', the whole trial")] = None
    axis: Annotated[str | None, Parameter("", "axis; default: every axis of the metric")] = None
    condition: Annotated[str | None, Parameter("", "condition; default: every one")] = None
    below: Annotated[Later, Parameter("", "upper limit, in the metric's unit")] = None
    above: Annotated[Later, Parameter("", "lower limit, in the metric's unit")] = None


@dataclass(frozen=True)
class Experiment:
    """An experiment as declared in its file. All values in SI units."""

    hilrig: Annotated[Literal[1], Parameter("", "version of the file format: 1")]
    name: Annotated[str, Parameter("", "name of the experiment, also used for folders")]
    question: Annotated[str, Parameter("", "the question that the experiment should answer")]
    driver: Annotated[Driver, Parameter("", "the plant: robot, surface, actuation")]
    task: Annotated[TaskSection, Parameter("", "axes and desired dynamics")]
    phases: Annotated[tuple[Phase, ...], Parameter("", "one after the other")]
    controllers: Annotated[Mapping[str, Controller], Parameter("", "the controllers to compare, by name")]
    conditions: Annotated[
        Mapping[str, tuple[Disturbance, ...]],
        Parameter("", "lists of disturbances, by name; every controller is run under each"),
    ] = field(default_factory=lambda: {"nominal": ()})
    period: Annotated[float, Parameter("s", "sampling period", 1e-4, 0.1, "log")] = 1e-3
    clock: Annotated[Literal["lockstep", "realtime"], Parameter("", "who waits for whom")] = "lockstep"
    actuation_delay: Annotated[int, Parameter("", "ticks from a measurement until its command acts", 0, 10)] = 1
    repeats: Annotated[int, Parameter("", "number of repeats, each with its own seed", 1, 10_000)] = 1
    seed: Annotated[int, Parameter("", "seed for everything random", 0, 2**63 - 1)] = 0
    expect: Annotated[tuple[Expectation, ...], Parameter("", "limits and outcomes that the run must meet")] = ()
    safety: Annotated[Limits, Parameter("", "safety limits")] = field(default_factory=Limits)
    rig: Annotated[RigSettings, Parameter("", "the real-time set-up")] = field(default_factory=RigSettings)
    timing: Annotated[TimingBudget, Parameter("", "timing limits of the loop in real time")] = field(
        default_factory=TimingBudget
    )
    source: Document | None = field(default=None, compare=False, repr=False, metadata={"filled": True})

    def place(self, *path: str | int) -> Place | None:
        """Return where in the file the value at `path` is, for example at ("phases", 0, "position")."""
        return self.source.place(*path) if self.source else None

    def to_document(self) -> dict[str, Any]:
        """Return the experiment as plain data for JSON, every quantity a number in SI units."""
        return {f.name: plugins.dump(getattr(self, f.name)) for f in fields(self) if f.name != "source"}

"""What a controller may say of itself before it runs: the bounds that its theory knows, on the loop that is planned."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np

from hilrig.core.interfaces import Task
from hilrig.core.signals import Array, Reference


class TipPath(NamedTuple):
    """Where the tip is meant to go, at K instants: every 10 ms and at the extremes of every axis in every phase.

    Along force-controlled axes it stays on the surface, or where the trial starts.
    """

    condition: str
    """Name of the condition; empty where all conditions have the same path and delay"""
    delay: int
    """Most samples between a measurement and its command's effect: actuation and measurement delay"""
    time: Array
    """(K,) s"""
    position: Array
    """x, (K, m) m"""
    reference: Reference
    """Of the law, arrays (K, m)"""
    jacobian: Array
    """J, (K, m, n)"""
    mobility: Array | None
    """M_t^-1 = J M^-1 J^T of the nominal robot, (K, m, m) 1/kg; None if the robot has no M that can be inverted"""
    places: tuple[str, ...]
    """Condition if it matters, phase, time and position in words, (K,)"""


class Setting(NamedTuple):
    """What a controller cannot know of itself: the loop, the task and the path that are planned for it."""

    task: Task
    """What `Controller.start` is told"""
    velocity_smoothing: float
    """a of the joint velocity filter q' += a ((q - q_prev)/l - q')"""
    joint_velocity_limit: float
    """Where safety ends a trial, rad/s"""
    tip_force_limit: float
    """Where safety ends a trial, N"""
    paths: tuple[TipPath, ...]
    """One for each condition that differs from the others in path or delay"""

    def lowest(self, values: Sequence[Array]) -> tuple[float, str]:
        """Return the smallest of `values`, one array (K,) for each path, and its place in words."""
        k = int(np.argmin([array.min() for array in values]))
        return float(values[k].min()), self.paths[k].places[int(values[k].argmin())]

    def highest(self, values: Sequence[Array]) -> tuple[float, str]:
        """Return the largest of `values`, one array (K,) for each path, and its place in words."""
        least, place = self.lowest([-array for array in values])
        return -least, place


class Bound(NamedTuple):
    """One value against the limit that a theory sets for it. A value that equals its limit does not keep it."""

    name: str
    """Of the bound: equation or condition, and of what"""
    value: float
    """As planned; may be infinite"""
    must: Literal["below", "above"]
    """Where the value must be to keep the bound"""
    limit: float
    unit: str
    """SI, of value and limit; "" for a pure number"""
    warning: str
    """What to tell people if the bound is not kept, value and limit included; "" if that should change no decision"""
    where: str = ""
    """The place on the path that decides, in words"""
    basis: str = ""
    """What value and limit follow from, in words, such as "kappa = 0.08\""""
    about: tuple[str | int, ...] = ()
    """Keys of the experiment file below the controller's name, such as ("gain",), to which a warning points"""
    recorded_as: Literal["", "command_age"] = ""
    """What the record of a trial in real time has of this value, for the report to hold against the limit as well:
    "command_age" is the delay from a measurement to its command in effect, s"""

    @property
    def kept(self) -> bool:
        """Whether the value is on the right side of its limit."""
        return self.value < self.limit if self.must == "below" else self.value > self.limit

    @property
    def margin(self) -> float:
        """The factor by which the value can change until it meets its limit; below 1 the bound is not kept."""
        part, whole = (self.value, self.limit) if self.must == "below" else (self.limit, self.value)
        return whole / part if part else np.inf

    def document(self) -> dict[str, Any]:
        """Return the bound as plain data; its warning is empty where it is kept."""
        judged = {"kept": self.kept, "margin": self.margin, "decides": bool(self.warning)}
        return {**self._asdict(), "warning": "" if self.kept else self.warning, **judged}


class Assessment(NamedTuple):
    """What a theory says of one controller, or of the task."""

    bounds: tuple[Bound, ...]
    unknown: tuple[str, ...] = ()
    """What cannot be judged and why, each a clause such as "the window of Mhat is not known: ..."; each is a warning"""
    note: str = ""
    """What readers of the report should know of these bounds, a few sentences"""

    def document(self) -> dict[str, Any]:
        """Return the assessment as plain data."""
        return {"bounds": [bound.document() for bound in self.bounds], "unknown": list(self.unknown), "note": self.note}


@runtime_checkable
class Assessing(Protocol):
    """What a controller may offer: `hilrig check` and the report ask for it, and print what it says."""

    def assess(self, setting: Setting) -> Assessment:
        """Return the bounds that the law's theory sets, as the controller's parameters and `setting` keep them."""
        ...

"""What a controller can report before it runs: the bounds that its theory sets on the planned loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np

from hilrig.core.interfaces import Task
from hilrig.core.signals import Array, Reference


class TipPath(NamedTuple):
    """The planned path of the tip, at K instants: every 10 ms and at the extremes of every axis in every phase.

    Along force-controlled axes it stays on the surface, or where the trial starts.
    """

    condition: str
    """Name of the condition; empty where all conditions have the same path and delay"""
    delay: int
    """Most samples between a measurement and the effect of its command: actuation plus measurement delay"""
    time: Array
    """(K,) s"""
    position: Array
    """x, (K, m) m"""
    reference: Reference
    """The law's reference, arrays (K, m)"""
    jacobian: Array
    """J, (K, m, n)"""
    mobility: Array | None
    """M_t^-1 = J M^-1 J^T of the nominal robot, (K, m, m) 1/kg; None if the robot has no M that can be inverted"""
    places: tuple[str, ...]
    """Condition (if it matters), phase, time and position in words, (K,)"""


class Setting(NamedTuple):
    """What a controller cannot know by itself: the planned loop, task and path."""

    task: Task
    """The task that `Controller.start` receives"""
    velocity_smoothing: float
    """a of the joint velocity filter q' += a ((q - q_prev)/l - q')"""
    joint_velocity_limit: float
    """Safety limit that ends a trial, rad/s"""
    tip_force_limit: float
    """Safety limit that ends a trial, N"""
    paths: tuple[TipPath, ...]
    """One per condition that differs from the others in path or delay"""

    def lowest(self, values: Sequence[Array]) -> tuple[float, str]:
        """Return the smallest of `values`, one array (K,) per path, and its place in words."""
        k = int(np.argmin([array.min() for array in values]))
        return float(values[k].min()), self.paths[k].places[int(values[k].argmin())]

    def highest(self, values: Sequence[Array]) -> tuple[float, str]:
        """Return the largest of `values`, one array (K,) per path, and its place in words."""
        least, place = self.lowest([-array for array in values])
        return -least, place


class Bound(NamedTuple):
    """One value and the limit that a theory sets for it. A value equal to its limit does not keep the bound."""

    name: str
    """Name of the bound: the equation or condition, and the quantity it applies to"""
    value: float
    """As planned; may be infinite"""
    must: Literal["below", "above"]
    """Side of the limit on which the value must be"""
    limit: float
    unit: str
    """SI unit of value and limit; "" for a pure number"""
    warning: str
    """Message for the user if the bound is not kept, with value and limit; "" if the bound should change no decision"""
    where: str = ""
    """The place on the path that decides, in words"""
    basis: str = ""
    """What the value and limit are based on, in words, such as "kappa = 0.08\""""
    about: tuple[str | int, ...] = ()
    """Keys of the experiment file, below the controller's name, that a warning points to, such as ("gain",)"""
    recorded_as: Literal["", "command_age"] = ""
    """Quantity in the record of a real-time trial that the report also compares with the limit: "command_age" is the
    delay from a measurement until its command is in effect, s"""

    @property
    def kept(self) -> bool:
        """Whether the value is on the right side of its limit."""
        return self.value < self.limit if self.must == "below" else self.value > self.limit

    @property
    def margin(self) -> float:
        """The factor by which the value can change before it reaches its limit; below 1 the bound is not kept.

        NaN if no factor leads from the one to the other.
        """
        part, whole = (self.value, self.limit) if self.must == "below" else (self.limit, self.value)
        if part > 0 and whole >= 0:
            return whole / part
        return np.inf if part == 0 and whole > 0 else np.nan

    def document(self) -> dict[str, Any]:
        """Return the bound as plain data; the warning is empty if the bound is kept."""
        judged = {"kept": self.kept, "margin": self.margin, "decides": bool(self.warning)}
        return {**self._asdict(), "warning": "" if self.kept else self.warning, **judged}


class Assessment(NamedTuple):
    """What a theory says about one controller, or about the task."""

    bounds: tuple[Bound, ...]
    unknown: tuple[str, ...] = ()
    """What cannot be judged and why, each a clause such as "the window of Mhat is not known: ..."; each is a warning"""
    note: str = ""
    """What readers of the report should know about these bounds, in a few sentences"""

    def document(self) -> dict[str, Any]:
        """Return the assessment as plain data."""
        return {"bounds": [bound.document() for bound in self.bounds], "unknown": list(self.unknown), "note": self.note}


@runtime_checkable
class Assessing(Protocol):
    """Optional interface of a controller: `hilrig check` and the report call it and print the result."""

    def assess(self, setting: Setting) -> Assessment:
        """Return the bounds that the law's theory sets, evaluated for the controller's parameters and `setting`."""
        ...

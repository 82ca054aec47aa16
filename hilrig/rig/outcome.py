"""The outcome of a trial as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from hilrig.experiment.trial import Trial


@dataclass(frozen=True)
class Outcome:
    """How one trial ended."""

    trial: str
    outcome: str
    """completed, tripped, aborted, timed_out or failed"""
    reason: str
    """Why, in one line; empty if completed"""
    ticks: int
    """Ticks that the driver completed"""
    planned_ticks: int
    wall_s: float
    """Time from the start of the first tick to the end of the record"""
    speed: float
    """Simulated time over wall time, without the start-up"""
    loop_s: float | None = None
    """Time from the start of the first tick to the end of the last one; None if unknown"""
    stages: Mapping[str, float] | None = None
    """How long each stage of the plant's life took, s, as its driver says; None if unknown"""
    held_command_age_s: float | None = None
    """How old the command in effect was when the plant was held, as its driver says; None if it was in lockstep"""
    channels: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        trial: Trial,
        outcome: str,
        reason: str,
        ticks: int,
        wall: float,
        channels: Mapping[str, Mapping[str, Any]],
        loop_s: float | None = None,
        stages: Mapping[str, float] | None = None,
        held_command_age_s: float | None = None,
    ) -> Outcome:
        """Return the outcome; a trial that ran to its end but lacks messages has failed."""
        if outcome == "completed" and (trouble := unexplained(channels)):
            outcome, reason = "failed", trouble
        speed = ticks * trial.period / wall if wall > 0 else 0.0
        return cls(
            trial.id, outcome, reason, ticks, trial.ticks, round(wall, 3), round(speed, 3),
            None if loop_s is None else round(loop_s, 4), stages, held_command_age_s, dict(channels),
        )  # fmt: skip

    @property
    def completed(self) -> bool:
        """Whether the trial ran to its end and its record is complete."""
        return self.outcome == "completed"

    def document(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def unexplained(channels: Mapping[str, Mapping[str, Any]]) -> str:
    """Return in words what is missing from the record; empty if every message that was sent was stored."""
    if not channels:
        return "the logger did not report what it stored"
    missing = [
        f"{name}: {account['stored']} stored, {'?' if account['sent'] is None else account['sent']} sent"
        for name, account in channels.items()
        if account["lost"] != 0
    ]
    return "messages are missing: " + "; ".join(missing) if missing else ""

"""Records for testing metrics: one phase of a trial."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from hilrig import Array, PhaseRecord

PERIOD = 1e-3


def record(ticks: int, axes: tuple[str, ...] = ("x", "z"), joints: int = 2, **changes: Any) -> PhaseRecord:
    """Return a phase at rest, with the last axis force-controlled and every signal zero except `changes`."""
    m, zeros = len(axes), np.zeros((ticks, len(axes)))
    sigma = np.array([1.0] * (m - 1) + [0.0])
    plain: dict[str, Any] = {
        "tick": np.arange(ticks, dtype=np.float64), "time": np.arange(ticks) * PERIOD, "phases": 1, "period": PERIOD,
        "axes": axes, "sigma": sigma, "inertia": np.array([3.0] * (m - 1) + [6.0]),
        "damping": np.array([30.0] * (m - 1) + [60.0]), "stiffness": 250.0 * sigma, "position": zeros,
        "velocity": zeros, "acceleration": zeros, "force": zeros, "reference_position": zeros,
        "reference_velocity": zeros, "reference_acceleration": zeros, "reference_force": zeros,
        "reference_step": np.zeros(m), "torque": np.zeros((ticks, joints)), "late": np.zeros(ticks),
    }  # fmt: skip
    return PhaseRecord(**{**plain, **changes})


def flawed(
    scale: float = 1.0, ticks: int = 2000, axes: tuple[str, ...] = ("x", "z"), joints: int = 2, **changes: Any
) -> PhaseRecord:
    """Return a phase with decaying errors of this scale: off its path, out of contact, restless and late."""
    time, m = np.arange(ticks) * PERIOD, len(axes)
    free, pressed = np.array([1.0] * (m - 1) + [0.0]), np.array([0.0] * (m - 1) + [1.0])
    fading = scale * np.exp(-5 * time)[:, None]
    error, force = fading * 0.01 * free, 3.5 * pressed * np.ones((ticks, 1))
    torque: Array = scale * np.sin(20 * time)[:, None] * (-1.0) ** np.arange(joints)
    shown = record(
        ticks, axes, joints, position=-error, velocity=5 * error, acceleration=-25 * error,
        force=np.maximum(force - 4.0 * fading * pressed, 0.0), reference_force=force, reference_step=0.01 * free,
        torque=torque, late=(np.arange(ticks) < 10 * scale) * 1.0,
    )  # fmt: skip
    return dataclasses.replace(shown, **changes)


def swinging(scale: float, sign: float) -> PhaseRecord:
    """Return a phase like `flawed`, whose errors swing about zero while they die out, and begin with this sign."""
    time, free, pressed = np.arange(2000) * PERIOD, np.array([1.0, 0.0]), np.array([0.0, 1.0])
    rate = -5 + 20j  # 1/s, of the errors e^(rate t)
    error, change, bend = ((scale * rate**k * np.exp(rate * time)).real[:, None] for k in range(3))
    step = sign * 0.01 * free
    return flawed(
        scale, position=-step * error, velocity=-step * change, acceleration=-step * bend, reference_step=step,
        force=np.maximum(3.5 - sign * 4.0 * error, 0.0) * pressed,
    )  # fmt: skip


def rows(whole: PhaseRecord, chosen: Any) -> PhaseRecord:
    """Return these ticks (a slice or a mask) of a record that has more ticks than axes and joints."""
    signals = {field.name: getattr(whole, field.name) for field in dataclasses.fields(whole)}
    over_time = {name: value for name, value in signals.items() if np.shape(value)[:1] == whole.tick.shape}
    return dataclasses.replace(whole, **{name: value[chosen] for name, value in over_time.items()})

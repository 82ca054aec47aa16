"""Inputs for testing control laws: the states and references of a robot that follows a path.

The loop is open: the law's torque moves nothing, so that gains for another robot do no harm.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hilrig import Array, Impedance, Kinematics, Law, Reference, State, Task
from hilrig.core.assessment import Setting, TipPath

PERIOD = 1e-3
TICKS = 200
MISSED = (60, 61, 130)
"""Ticks at which the law is not called, as can happen in real time"""
MASS, GRAVITY, BEND = 2.0, 9.81, 0.2


Group = TypeVar("Group", State, Reference)


class Tick(NamedTuple):
    """The inputs of a law at one tick."""

    state: State
    reference: Reference


class Scenario(NamedTuple):
    """A trial with m joints and m axes, the last one force-controlled; its arrays are not shared."""

    task: Task
    ticks: list[Tick]

    def reusing(self) -> Iterator[Tick]:
        """Yield the ticks in one set of arrays, which is spoilt and then rewritten before each tick."""
        room = Tick(_copied(self.ticks[0].state), _copied(self.ticks[0].reference))
        for tick in self.ticks:
            for target, source in ((room.state, tick.state), (room.reference, tick.reference)):
                for name, array in arrays(target):
                    array[...] = np.nan
                    array[...] = getattr(source, name)
            yield room._replace(state=room.state._replace(elapsed=tick.state.elapsed))


def scenario(axes: int, model: bool = True) -> Scenario:
    """Return a new scenario with this many axes; without `model` the robot has no dynamic parameters."""
    names = ("x", "y", "z")[-axes:]
    theta = np.concatenate([np.full(axes, MASS), np.zeros(2 * axes)]) if model else np.zeros(0)
    sigma = np.ones(axes)
    sigma[-1] = 0.0
    impedance = Impedance(sigma, np.full(axes, 3.0), np.full(axes, 30.0), 250.0 * sigma, reference_states=False)
    task = Task(PERIOD, names, impedance, theta, np.full(axes, 100.0))
    numbers = [k for k in range(TICKS) if k not in MISSED]
    gaps = np.diff(numbers, prepend=-1)
    return Scenario(task, [_tick(k, gap * PERIOD, axes, model) for k, gap in zip(numbers, gaps.tolist(), strict=True)])


def setting(axes: int, model: bool = True) -> Setting:
    """Return what `assess` is given on so many axes: two conditions, one with a longer delay than the other."""
    given = scenario(axes, model)
    return Setting(given.task, 0.5, 10.0, 100.0, (_path(given, "early", 1), _path(given, "late", 4)))


def arrays(group: Any) -> Iterator[tuple[str, Array]]:
    """Yield the arrays of a named tuple, by name."""
    for name, value in group._asdict().items():
        if isinstance(value, np.ndarray):
            yield name, value


def step(law: Law, tick: Tick) -> Array:
    """Return a copy of the law's torque at a tick, (n,) N m."""
    return np.array(law.step(law.parameters, law.memory, *tick), dtype=np.float64)


def kinematics(q: Array, rate: Array, model: bool = True) -> Kinematics:
    """Return the geometry of the robot, x_i = q_i + c sin q_(i+1) with q_(m+1) = q_1, and its nominal dynamics.

    theta (3m,): mass, Coulomb and viscous friction of each joint; gravity G_m = mass g cos q_m acts on the last one.
    """
    m = q.size
    ahead = np.roll(np.eye(m), 1, axis=1)
    jacobian = np.eye(m) + BEND * np.cos(ahead @ q)[:, None] * ahead
    jacobian_rate = -BEND * (np.sin(ahead @ q) * (ahead @ rate))[:, None] * ahead
    regressor = np.zeros((2 * m + 1, m, 3 * m if model else 0))
    if model:
        regressor[0, m - 1, m - 1] = GRAVITY * np.cos(q[m - 1])
        for i in range(m):
            regressor[0, i, m + i] = np.tanh(rate[i] / 5e-3)
            regressor[1 + i, i, 2 * m + i] = 1.0
            regressor[1 + m + i, i, i] = 1.0
    return Kinematics(q + BEND * np.sin(ahead @ q), jacobian @ rate, jacobian, jacobian_rate, regressor)


def _copied(group: Group) -> Group:
    return group._replace(**{name: array.copy() for name, array in arrays(group)})


def _tick(k: int, elapsed: float, axes: int, model: bool) -> Tick:
    t, i = k * PERIOD, np.arange(axes)
    q, rate = 0.02 * np.sin(9.0 * t + i), 0.18 * np.cos(9.0 * t + i) + 0.01 * np.sin(700.0 * t + i)
    at = kinematics(q, rate, model)
    force = np.zeros(axes)
    force[-1] = max(0.0, 800.0 * at.position[-1] + 20.0 * at.velocity[-1]) if at.position[-1] > 0 else 0.0
    torque = 3.0 * np.sin(30.0 * t + 2.0 * i)
    torque[-1] += MASS * GRAVITY
    free, pressed = np.ones(axes), np.zeros(axes)
    free[-1], pressed[-1] = 0.0, 1.0
    swing = 15.0 * t + i
    reference = Reference(
        free * (q + 0.01 * np.sin(swing)), free * 0.15 * np.cos(swing), free * -2.25 * np.sin(swing),
        pressed * (3.5 if k < TICKS // 2 else 5.0),
    )  # fmt: skip
    return Tick(State(q, rate, *at, force, torque, elapsed), reference)


def _path(given: Scenario, condition: str, delay: int) -> TipPath:
    """Return the path of the scenario's tip, every ten ticks."""
    ticks = given.ticks[::10]
    jacobian = np.array([tick.state.jacobian for tick in ticks])
    modelled = given.task.dynamic_parameters.size > 0
    return TipPath(
        condition, delay, np.cumsum([tick.state.elapsed for tick in ticks]),
        np.array([tick.state.position for tick in ticks]),
        Reference(*(np.array(signal) for signal in zip(*(tick.reference for tick in ticks), strict=True))),
        jacobian, jacobian @ jacobian.transpose(0, 2, 1) / MASS if modelled else None,
        tuple(f"condition '{condition}', place {k}" for k in range(len(ticks))),
    )  # fmt: skip

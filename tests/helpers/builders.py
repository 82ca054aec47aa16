"""What tests are made of: arms, surfaces, states, tasks and trials; plain values for all that a test does not say."""

from __future__ import annotations

import dataclasses
import types
import typing
from typing import Any

import numpy as np
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import Controller, Disturbance, Driver, Impedance, Plant, Task, TrialStart
from hilrig.core.parameters import Parameter
from hilrig.core.signals import Array, Command, DisturbanceSchedule, PlantDisturbance, Reference, State, Truth
from hilrig.experiment.trial import Limits, PhaseSpec, TaskSpec, Trial
from hilrig.kinds.contact import Surface
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.metrics._record import PhaseRecord
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.robots.planar_2r import Planar2r

STILL = PlantDisturbance(np.zeros(2), 0.0, 0.0, 1.0, 1.0, 1.0)
"""Nothing disturbs a plant with two task axes."""
PERIOD = 1e-3
TIME = np.arange(4000) * PERIOD
"""s: the ticks that `applied` disturbs"""


def arm(**changes: Any) -> Planar2r:
    """Return an arm of two rods in a vertical plane, gravity along -x."""
    plain: dict[str, Any] = {"lengths": (0.345, 0.2), "masses": (1.8, 1.1), "gravity": (-9.81, 0.0)}
    return Planar2r(**{**plain, **changes})


def surface(**changes: Any) -> Surface:
    """Return a surface at z = 0.35 m, 800 N/m."""
    return Surface(**{"position": 0.35, "stiffness": 800.0, "damping": 20.0, "friction": 0.2, **changes})


FAR_AWAY = surface(position=10.0)
"""A surface that the arm cannot reach."""


def impedance(m: int = 2, reference_states: bool = False) -> Impedance:
    """Return desired dynamics whose last axis is force-controlled."""
    sigma = np.ones(m)
    sigma[-1] = 0.0
    return Impedance(sigma, np.full(m, 3.0), np.full(m, 30.0), 250.0 * sigma, reference_states)


def task(robot: Planar2r, **changes: Any) -> Task:
    """Return the task of a control law for `robot`, 1 ms, last axis force-controlled."""
    plain = Task(PERIOD, robot.axes, impedance(), robot.dynamic_parameters(), robot.torque_limits())
    return plain._replace(**changes)


def state(robot: Planar2r, q: Array, rate: Array, force: Array | None = None, torque: Array | None = None) -> State:
    """Return what a law sees at (q, q') with the force F_e and last torque given (default zero)."""
    at = robot.kinematics(q, rate)
    still = np.zeros(2)
    return State(
        q, rate, at.position, at.velocity, at.jacobian, at.jacobian_rate, at.regressor,
        still if force is None else force, still if torque is None else torque, PERIOD,
    )  # fmt: skip


def reference(m: int = 2, **changes: Array) -> Reference:
    """Return a reference that is zero but for `changes`."""
    return Reference(*(np.zeros(m) for _ in Reference._fields))._replace(**changes)


def torque_command(torque: Array | tuple[float, float], q: Array | None = None) -> Command:
    """Return a command of a torque (2,) N m."""
    return Command(np.array(torque, dtype=np.float64), np.zeros(2) if q is None else q)


def begin(driver: Driver, q: Array | tuple[float, float], period: float = PERIOD) -> Plant:
    """Return the driver's plant at rest at q, measured once, as the rig does before anything else."""
    plant = driver.begin(TrialStart(period, np.array(q, dtype=np.float64)))
    plant.measure(STILL)
    return plant


def true_state(plant: Plant, disturbance: PlantDisturbance = STILL) -> Truth:
    """Return the truth of a simulated plant."""
    truth = plant.truth(disturbance)
    assert truth is not None
    return truth


def trial(driver: Driver | None = None, controller: Controller | None = None, **changes: Any) -> Trial:
    """Return a trial of 0.2 s on the two-link arm: hold x where it is, press with 3.5 N."""
    phase = PhaseSpec("press", 0.0, 0.2, {"x": Hold(0.1)}, {"z": Hold(3.5)})
    spec = TaskSpec(("z",), (3.0, 6.0), (30.0, 60.0), (250.0, 0.0), "measured", 60.0)
    plain: dict[str, Any] = {
        "id": "mine.quiet.0", "controller_name": "mine", "condition_name": "quiet", "repeat": 0, "seed": (7, 0),
        "period": PERIOD, "clock": "lockstep", "actuation_delay": 1, "driver": driver or TwoLink(arm(), surface()),
        "controller": controller or Pd(), "task": spec, "phases": (phase,), "disturbances": (), "limits": Limits(),
        "start_position": (0.1, 0.35),
    }  # fmt: skip
    return Trial(**{**plain, **changes})


def applied(*disturbances: Disturbance, seed: int = 0) -> DisturbanceSchedule:
    """Return the schedule of 4 s on two joints and the axes x and z, with `disturbances` applied in order."""
    schedule = DisturbanceSchedule.quiet(TIME.size, 2, 2)
    for disturbance in disturbances:
        disturbance.apply(schedule, TIME, ("x", "z"), np.random.default_rng(seed))
    return schedule


def record(ticks: int, **changes: Any) -> PhaseRecord:
    """Return a phase of rest: x position-controlled, z force-controlled, every signal zero but for `changes`."""
    zeros = np.zeros((ticks, 2))
    plain: dict[str, Any] = {
        "tick": np.arange(ticks, dtype=np.float64), "time": np.arange(ticks) * PERIOD, "phases": 1, "period": PERIOD,
        "axes": ("x", "z"), "sigma": np.array([1.0, 0.0]), "inertia": np.array([3.0, 6.0]),
        "damping": np.array([30.0, 60.0]), "stiffness": np.array([250.0, 0.0]), "position": zeros, "velocity": zeros,
        "acceleration": zeros, "force": zeros, "reference_position": zeros, "reference_velocity": zeros,
        "reference_acceleration": zeros, "reference_force": zeros, "reference_step": np.zeros(2), "torque": zeros,
        "late": np.zeros(ticks),
    }  # fmt: skip
    return PhaseRecord(**{**plain, **changes})


def example(cls: type, **known: Any) -> Any:
    """Return an instance of a plug-in's class, found values for the fields that have no default.

    `known` gives values by field name, for the fields that the class has. A number is 1.5, moved into its bounds;
    a sequence of numbers 0, 1, 2; a robot or a surface one of this module's.
    """
    hints = typing.get_type_hints(cls, include_extras=True)
    values = {}
    for item in dataclasses.fields(cls):
        if item.name in known:
            values[item.name] = known[item.name]
        elif item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING:
            values[item.name] = _value(hints[item.name])
    return cls(**values)


def parameter_of(hint: Any) -> Parameter | None:
    """Return the Parameter in an annotation, if it has one."""
    return next((part for part in getattr(hint, "__metadata__", ()) if isinstance(part, Parameter)), None)


def _value(hint: Any) -> Any:
    kind = hint.__origin__ if hasattr(hint, "__metadata__") else hint
    if kind is Planar2r:
        return arm()
    if kind is Surface:
        return surface()
    known = parameter_of(hint) or Parameter("")
    number = float(min(max(1.5, known.low), known.high))
    if typing.get_origin(kind) is tuple:
        size = len(typing.get_args(kind))
        return (0.0, 1.0, 2.0) if typing.get_args(kind)[-1] is Ellipsis else (number,) * size
    if kind is float or (isinstance(kind, types.UnionType) and float in typing.get_args(kind)):
        return number
    raise TypeError(f"no example for a field of type {hint}")

"""What tests are made of: arms, surfaces, states, tasks and trials; plain values for all that a test does not say."""

from __future__ import annotations

from typing import Any

import numpy as np
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import Controller, Driver, Impedance, Plant, Task, TrialStart
from hilrig.core.signals import Array, Command, PlantDisturbance, Reference, State, Truth
from hilrig.experiment.trial import Limits, PhaseSpec, TaskSpec, Trial
from hilrig.kinds.contact import Surface
from hilrig.kinds.controllers.pd import Pd
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.robots.planar_2r import Planar2r
from hilrig.testing.records import record as record
from hilrig.testing.schedule import TIME as TIME
from hilrig.testing.schedule import applied as applied

STILL = PlantDisturbance(np.zeros(2), 0.0, 0.0, 1.0, 1.0, 1.0)
"""Nothing disturbs a plant with two task axes."""
PERIOD = 1e-3


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
    plant = driver.connect(TrialStart(period, np.array(q, dtype=np.float64), np.zeros(2)))
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

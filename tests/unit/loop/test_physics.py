"""The rig against mechanics: a moving surface against the desired dynamics' transfer function, and momentum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers import rods
from helpers.builders import FAR_AWAY, STILL, arm, begin, surface, torque_command, trial, true_state
from helpers.in_memory import run
from hilrig_drivers.two_link import TwoLink

from hilrig.core.interfaces import Controller
from hilrig.core.signals import Array, Truth
from hilrig.experiment.trial import PhaseSpec
from hilrig.kinds.controllers.sliding_mode import SlidingMode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.disturbances.surface_motion import SurfaceMotion
from hilrig.kinds.references.hold import Hold

K_E, B_E, M_D, B_D = 800.0, 20.0, 6.0, 60.0


def force_per_motion(frequency: float) -> complex:
    """Return F_e / z_e of the desired dynamics in contact, N/m, at `frequency` in Hz.

    M_d z'' + B_d z' = F_d - F_e and F_e = K_e (z - z_e) + B_e (z' - z_e'): with the contact's C = K_e + B_e s and the
    arm's Z = M_d s^2 + B_d s, F_e / z_e = -C Z / (C + Z).
    """
    s = 2j * np.pi * frequency
    contact, arm_side = K_E + B_E * s, M_D * s**2 + B_D * s
    return -contact * arm_side / (contact + arm_side)


def phasor(time: Array, values: Array, frequency: float) -> complex:
    """Return c of values = Im(c e^(2 pi i f t)) + mean, by least squares."""
    columns = np.stack([np.sin(2 * np.pi * frequency * time), np.cos(2 * np.pi * frequency * time), np.ones(time.size)])
    sine, cosine, _ = np.linalg.lstsq(columns.T, values, rcond=None)[0]
    return complex(sine, cosine)


STIFF = TdeSlidingMode(inertia_estimate=0.3, position_gain=2500.0, velocity_gain=100.0)
"""Gains with which p_d - x, about (l/Mhat) s F / (s^2 + k_d s + k_p), is 2 % of the surface's motion at 2 Hz"""


@pytest.mark.parametrize("frequency", [1.0, 2.0])
@pytest.mark.parametrize("controller", [STIFF, SlidingMode(slope=80.0)], ids=["tde", "sliding_mode"])
def test_force_against_a_moving_surface_is_the_desired_dynamics(controller: Controller, frequency: float) -> None:
    """A filter on its own states is an admittance; a law that follows it well makes the arm that admittance."""
    amplitude, duration = 1e-3, 3.0
    spec = replace(trial().task, states="reference", velocity_cutoff=400.0)
    rail = TwoLink(arm(), surface(stiffness=K_E, damping=B_E, friction=0.0))
    moved = trial(
        rail, controller, task=spec, actuation_delay=0, start_position=(0.1, 0.35 + 3.5 / K_E),
        phases=(PhaseSpec("press", 0.0, duration, {"x": Hold(0.1)}, {"z": Hold(3.5)}),),
        disturbances=(SurfaceMotion(amplitude=amplitude, frequency=2 * np.pi * frequency),),
    )  # fmt: skip
    seen = run(moved)
    assert seen.ending.outcome == "completed"
    assert seen.force[:, 1].min() > 0.5, "contact is never lost: the loop is linear"
    last = seen.time >= 1.0
    found = phasor(seen.time[last], seen.force[last, 1], frequency) / amplitude
    expected = force_per_motion(frequency)
    assert abs(found) == pytest.approx(abs(expected), rel=0.02)
    assert np.degrees(np.angle(found / expected)) == pytest.approx(0.0, abs=1.0)


WEIGHTLESS = arm(gravity=(0.0, 0.0))


def momentum(now: Truth) -> float:
    """Return (M q')_1, the generalised momentum about the shoulder, kg m^2/s, from point masses."""
    return float((rods.mass_matrix(WEIGHTLESS, now.joint_position) @ now.joint_velocity)[0])


def thrown(driver: TwoLink, ticks: int, period: float) -> list[Truth]:
    """Push the arm for 50 ms by its motors, then let it go; return the truth from then on, at every tick."""
    plant = begin(driver, (0.2, 1.0), period)
    for _ in range(round(0.05 / period)):
        plant.advance(torque_command((3.0, -1.0)), STILL)
    seen = [true_state(plant)]
    for _ in range(ticks):
        plant.advance(torque_command((0.0, 0.0)), STILL)
        seen.append(true_state(plant))
    return seen


def test_momentum_about_the_shoulder_is_kept_in_free_space() -> None:
    """No gravity, no torque: d/dt dT/dq_1' = 0, while the second joint's momentum changes."""
    seen = thrown(TwoLink(WEIGHTLESS, FAR_AWAY), 1000, 1e-3)
    kept = np.array([momentum(now) for now in seen])
    other = [(rods.mass_matrix(WEIGHTLESS, now.joint_position) @ now.joint_velocity)[1] for now in seen]
    assert kept[0] == pytest.approx(3.0 * 0.05, rel=1e-9), "what the motors put in, torque times time"
    np.testing.assert_allclose(kept, kept[0], rtol=1e-8)
    assert np.ptp(other) > 0.1 * abs(kept[0])


def test_impulse_of_a_blow_is_the_change_of_momentum() -> None:
    """About the shoulder: change of (M q')_1 = - integral of (x F_z - z F_x) dt."""
    dt = 1e-4
    seen = thrown(TwoLink(WEIGHTLESS, surface(position=0.33, friction=0.3), substep=dt), 8000, dt)
    force = np.array([now.wrench[[0, 2]] for now in seen])
    place = np.array([now.position for now in seen])
    touched = force[:, 1] > 0
    assert not touched[0]
    assert touched.any()
    assert not touched[-1]
    impulse = np.trapezoid(place[:, 0] * force[:, 1] - place[:, 1] * force[:, 0], dx=dt)
    change = momentum(seen[-1]) - momentum(seen[0])
    assert abs(change) > 0.02
    assert change == pytest.approx(-impulse, rel=2e-3)

"""The proposed law against the paper's equations, written a second time."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from builders import PERIOD, arm, impedance, state, task

from hilrig.controllers import tde_sliding_mode
from hilrig.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.interfaces import Impedance
from hilrig.signals import Array, Reference, State

ARM = arm()
Q = np.array([0.4, 1.3])


def test_p_solves_the_lyapunov_equation() -> None:
    c = TdeSlidingMode(position_gain=150.0, velocity_gain=30.0).start(task(ARM), state(ARM, Q, np.zeros(2))).parameters
    a = np.array([[0.0, 1.0], [-150.0, -30.0]])
    p = scipy.linalg.solve_continuous_lyapunov(a.T, -np.eye(2))
    np.testing.assert_allclose([c.p12, c.p22], p[1], rtol=1e-10)


@pytest.mark.parametrize("norm", [0.0, 0.4])
def test_gains_follow_their_closed_form_down_to_the_floor(norm: float) -> None:
    """alpha_2 = sqrt(1 - 2t) reaches 0.5 at 0.375 s; alpha_3 = sqrt(1 - 2 |xi| t)."""
    c = TdeSlidingMode().start(task(ARM), state(ARM, Q, np.zeros(2))).parameters
    gains, xi = np.array([0.01, 1.0, 1.0]), np.array([0.6 * norm, 0.8 * norm])
    floor_reached = None
    for k in range(1, 1201):
        tde_sliding_mode.adapt(c, PERIOD, gains, xi, xi)
        t = k * PERIOD
        assert gains[1] == pytest.approx(max(np.sqrt(max(1 - 2 * t, 0)), 0.5), abs=2e-3)
        assert gains[2] == pytest.approx(max(np.sqrt(max(1 - 2 * norm * t, 0)), 0.5), abs=2e-3)
        floor_reached = floor_reached or (t if gains[1] == 0.5 else None)
    assert floor_reached == pytest.approx(0.375, abs=2e-3)


def tde_again(s: dict, now: State, wanted: Reference, desired: Impedance) -> Array:
    """One step of the proposed law in plain NumPy, written from the equations; `s` holds its memory and two gains."""
    kp, kd, mhat, elapsed = 150.0, 30.0, 0.03, now.elapsed
    sigma = np.diag(desired.sigma)
    drive = -desired.damping * (now.velocity - sigma @ wanted.velocity) - desired.stiffness * (
        sigma @ (now.position - wanted.position)
    )
    drive += (np.eye(2) - sigma) @ wanted.force - now.force
    a_d = drive / desired.inertia + sigma @ wanted.acceleration
    s["v"] = np.clip(s["v"] + elapsed * a_d, now.velocity - 0.1, now.velocity + 0.1)
    s["p"] = np.clip(s["p"] + elapsed * s["v"], now.position - 0.02, now.position + 0.02)
    e, e_rate = s["p"] - now.position, s["v"] - now.velocity
    xi = e / (2 * kp) + (1 + 1 / kp) / (2 * kd) * e_rate
    n, growing = np.linalg.norm(xi), xi @ (xi - s["xi"]) > 0
    a1, a2, a3 = s["alpha"]
    rises = a1 <= 0.005 or (growing and a2 > 0.5 and a3 > 0.5)
    new_1 = a1 + elapsed * s["growth"] * n if rises else max(a1 - elapsed * s["decay"] * n, 0.0)
    new_3 = max(a3 - elapsed * n / a3, 0.5) if a3 > 0.5 else a3
    new_2 = max(a2 - elapsed / a2, 0.5) if a2 > 0.5 else a2
    s["alpha"], s["xi"] = np.array([new_1, new_2, new_3]), xi
    u = a_d + kd * e_rate + kp * e + 1.1 * s["alpha"].sum() * np.tanh(xi / 0.01)
    before = np.linalg.inv(now.jacobian).T @ now.torque - mhat * (now.velocity - s["xd"]) / elapsed
    s["xd"] = now.velocity
    return now.jacobian.T @ (mhat * u + before)


def test_step_is_the_law_written_again() -> None:
    rng = np.random.default_rng(3)
    start = state(ARM, Q, np.zeros(2), torque=np.array([1.0, 2.0]))
    law = TdeSlidingMode(growth=2.0, decay=0.5).start(task(ARM), start)
    again = {
        "growth": 2.0,
        "decay": 0.5,
        "p": start.position,
        "v": np.zeros(2),
        "xi": np.zeros(2),
        "alpha": np.array([0.01, 1, 1]),
        "xd": np.zeros(2),
    }
    for _ in range(800):
        now = state(
            ARM,
            Q + rng.normal(size=2, scale=0.02),
            rng.normal(size=2, scale=0.1),
            rng.normal(size=2),
            rng.normal(size=2),
        )._replace(elapsed=PERIOD * rng.choice([1, 13]))
        wanted = Reference(*rng.normal(size=(4, 2), scale=0.3))
        expected = tde_again(again, now, wanted, impedance())
        np.testing.assert_allclose(law.step(law.parameters, law.memory, now, wanted), expected, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(alphas(law.memory), again["alpha"], rtol=1e-12)
    assert law.memory.alpha_2[0] == 0.5, "the walk passed through the whole adaptation"

"""The proposed law against the paper's equations, written a second time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from helpers.builders import PERIOD, arm, impedance, state, task

from hilrig.core.interfaces import Impedance
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.controllers import tde_sliding_mode
from hilrig.kinds.controllers.tde_sliding_mode import Memory, TdeSlidingMode

ARM = arm()
Q = np.array([0.4, 1.3])


def test_p_solves_the_lyapunov_equation() -> None:
    c = TdeSlidingMode(position_gain=150.0, velocity_gain=30.0).start(task(ARM), state(ARM, Q, np.zeros(2))).parameters
    a = np.array([[0.0, 1.0], [-150.0, -30.0]])
    p = scipy.linalg.solve_continuous_lyapunov(a.T, -np.eye(2))
    np.testing.assert_allclose([c.p12, c.p22], p[1], rtol=1e-10)


def test_transposed_p_is_the_printed_one() -> None:
    """A P + P A^T = -I gives the paper's P_o = [[.1168, -.5], [-.5, 2.5167]]."""
    a = np.array([[0.0, 1.0], [-150.0, -30.0]])
    p = scipy.linalg.solve_continuous_lyapunov(a, -np.eye(2))
    np.testing.assert_allclose(p, [[0.1168, -0.5], [-0.5, 2.5167]], atol=5e-5)
    np.testing.assert_allclose(TdeSlidingMode(lyapunov="transposed").surface_gains(), p[1], rtol=1e-10)


@pytest.mark.parametrize(("lyapunov", "rate"), [("solved", -0.199), ("transposed", 0.199)])
def test_sliding_dynamics_are_stable_with_the_solved_p_only(lyapunov: str, rate: float) -> None:
    """xi = p12 e + p22 e' = 0 is e' = -(p12/p22) e, of magnitude k_d/(1 + k_p) in both readings."""
    p12, p22 = TdeSlidingMode(lyapunov=lyapunov).surface_gains()
    assert -p12 / p22 == pytest.approx(rate, abs=5e-4)
    assert abs(p12 / p22) == pytest.approx(30.0 / 151.0)


def adapting(controller: TdeSlidingMode, xi: Callable[[float], Array], duration: float = 1.2) -> Array:
    """Return (t, alpha_1, alpha_2, alpha_3) at every tick, (N, 4), for a given xi(t)."""
    law = controller.start(task(ARM), state(ARM, Q, np.zeros(2)))
    rows = []
    for k in range(1, round(duration / PERIOD) + 1):
        now = xi(k * PERIOD)
        outward = now @ (now - law.memory.sliding_variable) > 0
        tde_sliding_mode.adapt(law.parameters, law.memory, PERIOD, float(np.linalg.norm(now)), bool(outward))
        law.memory.sliding_variable[:] = now
        rows.append([k * PERIOD, *alphas(law.memory)])
    return np.array(rows)


@pytest.mark.parametrize(
    ("alphas_before", "outward", "adaptation", "step_1"),
    [
        ((0.005, 0.5, 0.5), False, "complete", +2.0),  # at its floor it rises
        ((0.006, 0.5, 0.5), False, "complete", -0.5),
        ((0.006, 1.0, 1.0), True, "complete", +2.0),
        ((0.006, 1.0, 0.5), True, "complete", -0.5),  # one of the two is at its floor
        ((0.006, 0.5, 1.0), True, "complete", -0.5),
        ((0.006, 1.0, 1.0), False, "complete", -0.5),
        ((0.006, 0.5, 0.5), False, "printed", -0.5),
        ((0.006, 1.0, 0.5), False, "printed", 0.0),
        ((0.006, 0.5, 1.0), False, "printed", 0.0),
        ((0.006, 0.5, 0.5), True, "printed", 0.0),
    ],
)
def test_every_case_of_alpha_1(
    alphas_before: tuple[float, float, float], outward: bool, adaptation: str, step_1: float
) -> None:
    """alpha_1' = k_1 |xi|, -k_2 |xi| or 0, with k_1 = 2, k_2 = 0.5 and |xi| = 0.3."""
    controller = TdeSlidingMode(growth=2.0, decay=0.5, gains_start=alphas_before, adaptation=adaptation)
    law = controller.start(task(ARM), state(ARM, Q, np.zeros(2)))
    tde_sliding_mode.adapt(law.parameters, law.memory, PERIOD, 0.3, outward)
    assert law.memory.alpha_1[0] == pytest.approx(alphas_before[0] + PERIOD * step_1 * 0.3, rel=1e-12)


def test_alpha_1_stays_above_zero() -> None:
    law = TdeSlidingMode(gains_start=(0.006, 0.5, 0.5)).start(task(ARM), state(ARM, Q, np.zeros(2)))
    tde_sliding_mode.adapt(law.parameters, law.memory, 1.0, 0.3, False)
    assert law.memory.alpha_1[0] == 0.0


def test_xi_that_stands_still_does_not_move_outward() -> None:
    """s = xi . (xi - xi_prev) = 0: with k_1 and k_2 unlike, the sign of alpha_1' tells."""
    now = state(ARM, Q, np.zeros(2))
    still = Reference(now.position, *np.zeros((3, 2)))
    law = TdeSlidingMode(gains_start=(0.1, 1.0, 1.0)).start(task(ARM), now)
    law.memory.filter_position[:] += 0.01  # a_d = 0: the filter stays where it is, and so does xi
    law.step(law.parameters, law.memory, now, still)
    before = law.memory.alpha_1[0]
    law.step(law.parameters, law.memory, now, still)
    assert law.memory.alpha_1[0] < before


def alphas(memory: Memory) -> Array:
    return np.concatenate([memory.alpha_1, memory.alpha_2, memory.alpha_3])


@pytest.mark.parametrize("norm", [0.0, 0.4])
def test_gains_follow_their_closed_form_down_to_the_floor(norm: float) -> None:
    """alpha_2 = sqrt(1 - 2t) reaches 0.5 at (1 - .25)/2 = .375 s; alpha_3 = sqrt(1 - 2 |xi| t)."""
    t, _, alpha_2, alpha_3 = adapting(TdeSlidingMode(), lambda t: np.array([0.6, 0.8]) * norm).T
    np.testing.assert_allclose(alpha_2, np.maximum(np.sqrt(np.maximum(1 - 2 * t, 0)), 0.5), atol=2e-3)
    np.testing.assert_allclose(alpha_3, np.maximum(np.sqrt(np.maximum(1 - 2 * norm * t, 0)), 0.5), atol=2e-3)
    assert t[alpha_2 == 0.5][0] == pytest.approx(0.375, abs=2e-3)


def test_alpha_1_rises_while_xi_moves_outward_and_falls_to_its_floor_after() -> None:
    """|xi| = 0.2 t up to 0.3 s: alpha_1 = .01 + k_1 0.1 t^2. Then |xi| holds 0.06: it falls by k_2 0.06 t to .005."""
    t, alpha_1, _, _ = adapting(
        TdeSlidingMode(growth=2.0, decay=0.5), lambda t: np.array([0.6, -0.8]) * 0.2 * min(t, 0.3)
    ).T
    rising = t < 0.2995
    np.testing.assert_allclose(alpha_1[rising], 0.01 + 0.2 * t[rising] ** 2, atol=2e-4)
    top = alpha_1[rising][-1]
    np.testing.assert_allclose(alpha_1[~rising], np.maximum(top - 0.03 * (t[~rising] - 0.3), 0.005), atol=3e-4)
    assert alpha_1[-1] == pytest.approx(0.005, abs=3e-4)


@pytest.mark.parametrize(("adaptation", "falls"), [("complete", True), ("printed", False)])
def test_printed_adaptation_holds_alpha_1_where_no_case_applies(adaptation: str, falls: bool) -> None:
    """xi stands still (not outward) while alpha_2, alpha_3 are above their floors: neither printed case applies."""
    controller = TdeSlidingMode(adaptation=adaptation, gains_start=(0.1, 1.0, 1.0))
    t, alpha_1, alpha_2, alpha_3 = adapting(controller, lambda t: np.full(2, 0.2 if t < 1.5 else 0.0), 2.0).T
    size = 0.2 * np.sqrt(2)
    uncovered = (t > 0.0015) & ((alpha_2 > 0.5) | (alpha_3 > 0.5)) & (t < 0.3)
    slope = np.diff(alpha_1[uncovered]) / PERIOD
    np.testing.assert_allclose(slope, -size if falls else 0.0, atol=1e-9)
    if not falls:  # alpha_3 reaches its floor at .375/size = 1.33 s; then the second case applies
        covered = (t > 1.35) & (t < 1.49)
        np.testing.assert_allclose(np.diff(alpha_1[covered]) / PERIOD, -size, rtol=1e-9)


OTHER_NUMBERS = {
    "inertia_estimate": (0.05, 0.02), "position_gain": 90.0, "velocity_gain": 20.0, "robust_gain": 2.0,
    "boundary": 0.003, "gains_start": (0.5, 0.8, 0.9), "gains_floor": (0.002, 0.3, 0.7),
}  # fmt: skip


def tde_again(s: dict, now: State, wanted: Reference, desired: Impedance) -> Array:
    """One step of the proposed law in plain NumPy, written from the equations; `s` holds its memory and its options."""
    law, elapsed = s["law"], now.elapsed
    kp, kd, mhat = law.position_gain, law.velocity_gain, np.broadcast_to(law.inertia_estimate, 2)
    floor_1, floor_2, floor_3 = law.gains_floor
    sigma = np.diag(desired.sigma)
    drive = -desired.damping * (now.velocity - sigma @ wanted.velocity) - desired.stiffness * (
        sigma @ (now.position - wanted.position)
    )
    drive += (np.eye(2) - sigma) @ wanted.force - now.force
    a_d = drive / desired.inertia + sigma @ wanted.acceleration
    s["v"] = np.clip(s["v"] + elapsed * a_d, now.velocity - 0.1, now.velocity + 0.1)
    s["p"] = np.clip(s["p"] + elapsed * s["v"], now.position - 0.02, now.position + 0.02)
    e, e_rate = s["p"] - now.position, s["v"] - now.velocity
    xi = s["row"] @ [e, e_rate]
    n, growing = np.linalg.norm(xi), xi @ (xi - s["xi"]) > 0
    a1, a2, a3 = s["alpha"]
    rises = a1 <= floor_1 or (growing and a2 > floor_2 and a3 > floor_3)
    falls = not rises if law.adaptation == "complete" else not rises and not growing and a2 <= floor_2 and a3 <= floor_3
    new_1 = a1 + elapsed * law.growth * n if rises else max(a1 - elapsed * law.decay * n, 0.0) if falls else a1
    new_3 = max(a3 - elapsed * n / a3, floor_3) if a3 > floor_3 else a3
    new_2 = max(a2 - elapsed / a2, floor_2) if a2 > floor_2 else a2
    s["alpha"], s["xi"] = np.array([new_1, new_2, new_3]), xi
    sign = -1 if law.feedback == "positive" else 1
    smooth = np.tanh(xi / law.boundary)
    robust = smooth if law.switching == "smooth" else np.tanh(xi) if n > law.boundary else xi / law.boundary
    u = a_d + sign * (kd * e_rate + kp * e) + law.robust_gain * s["alpha"].sum() * robust
    acceleration = s["a_d"] if law.estimator == "desired" else (now.velocity - s["xd"]) / elapsed
    held = now.torque if s["started"] or law.preload else np.zeros(2)
    before = np.linalg.inv(now.jacobian).T @ held - mhat * acceleration
    s["xd"], s["a_d"], s["started"] = now.velocity, a_d, True
    return now.jacobian.T @ (mhat * u + before)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"estimator": "desired"},
        {"lyapunov": "transposed"},
        {"feedback": "positive"},
        {"switching": "printed"},
        {"adaptation": "printed"},
        {"preload": False},
        OTHER_NUMBERS,
        {**OTHER_NUMBERS, "adaptation": "printed", "switching": "printed", "estimator": "desired"},
        {"estimator": "desired", "lyapunov": "transposed", "feedback": "positive", "switching": "printed",
         "adaptation": "printed", "preload": False},
    ],
    ids=lambda options: "+".join(options) or "default",
)  # fmt: skip
def test_step_is_the_law_written_again(options: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    start = state(ARM, Q, np.array([0.3, -0.4]), torque=np.array([1.0, 2.0]))
    controller = TdeSlidingMode(growth=2.0, decay=0.5, **options)
    law = controller.start(task(ARM), start)
    a = np.array([[0.0, 1.0], [-controller.position_gain, -controller.velocity_gain]])
    p = scipy.linalg.solve_continuous_lyapunov(a if controller.lyapunov == "transposed" else a.T, -np.eye(2))
    again = {
        "law": controller,
        "row": p[1],
        "p": start.position,
        "v": start.velocity,
        "xi": np.zeros(2),
        "alpha": np.array(controller.gains_start),
        "xd": start.velocity,
        "a_d": np.zeros(2),
        "started": False,
    }
    sizes = []
    for _ in range(1500):
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
        sizes.append(np.linalg.norm(law.memory.sliding_variable))
    assert law.memory.alpha_2[0] == controller.gains_floor[1], "the walk passed through the adaptation"
    if "lyapunov" in options:
        assert law.memory.alpha_3[0] == 0.5, "with the large printed p22, through that of alpha_3, too"
        assert max(sizes) > 0.01, "and out of the boundary layer"


def test_options_differ_in_the_walk() -> None:
    """Each option changes the torque of some step: none is read and forgotten."""
    steps = {}
    for options in ({}, {"estimator": "desired"}, {"lyapunov": "transposed"}, {"feedback": "positive"},
                    {"switching": "printed"}, {"adaptation": "printed"}, {"preload": False}):  # fmt: skip
        law = TdeSlidingMode(boundary=1e-4, **options).start(
            task(ARM), state(ARM, Q, np.zeros(2), torque=np.array([1.0, 2.0]))
        )
        torques = []
        for rate in ([0.1, 0.1], [0.2, 0.1], [0.1, 0.0], [0.05, 0.0]):
            now = state(ARM, Q, np.array(rate), torque=np.array([1.0, 2.0]))
            wanted = Reference(now.position + 0.1, np.zeros(2), np.zeros(2), np.ones(2))
            torques.append(law.step(law.parameters, law.memory, now, wanted))
        steps[str(options)] = np.array(torques).tobytes()
    assert len(set(steps.values())) == len(steps)

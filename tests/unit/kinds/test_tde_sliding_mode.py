"""The proposed law against the paper's equations, written a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg
from helpers.builders import PERIOD, arm, state, task
from helpers.tde_again import OTHER_NUMBERS, adapting, compared

from hilrig.core.signals import Reference
from hilrig.kinds.controllers import tde_sliding_mode
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode

ARM = arm()
Q = np.array([0.4, 1.3])


def test_p_solves_the_lyapunov_equation() -> None:
    c = TdeSlidingMode(position_gain=150.0, velocity_gain=30.0).start(task(ARM), state(ARM, Q, np.zeros(2))).parameters
    a = np.array([[0.0, 1.0], [-150.0, -30.0]])
    p = scipy.linalg.solve_continuous_lyapunov(a.T, -np.eye(2))
    np.testing.assert_allclose([c.p12, c.p22], p[1], rtol=1e-10)


@pytest.mark.parametrize(
    ("alphas_before", "outward", "step_1"),
    [
        ((0.005, 0.5, 0.5), False, +2.0),  # at its floor it rises
        ((0.006, 0.5, 0.5), False, -0.5),
        ((0.006, 1.0, 1.0), True, +2.0),
        ((0.006, 1.0, 0.5), True, -0.5),  # one of the two is at its floor
        ((0.006, 0.5, 1.0), True, -0.5),
        ((0.006, 1.0, 1.0), False, -0.5),
    ],
)
def test_every_case_of_alpha_1(alphas_before: tuple[float, float, float], outward: bool, step_1: float) -> None:
    """alpha_1' = k_1 |xi|, -k_2 |xi| or 0, with k_1 = 2, k_2 = 0.5 and |xi| = 0.3."""
    controller = TdeSlidingMode(growth=2.0, decay=0.5, gains_start=alphas_before)
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


def test_sliding_dynamics_are_stable() -> None:
    """xi = p12 e + p22 e' = 0 is e' = -(p12/p22) e, with p12/p22 = k_d/(1 + k_p)."""
    p12, p22 = TdeSlidingMode().surface_gains()
    assert p12 / p22 == pytest.approx(30.0 / 151.0)


@pytest.mark.parametrize(
    "options", [{}, {"preload": False}, OTHER_NUMBERS], ids=lambda options: "+".join(options) or "default"
)
def test_step_is_the_law_written_again(options: dict[str, Any]) -> None:
    controller = TdeSlidingMode(growth=2.0, decay=0.5, **options)
    memory, _ = compared(controller)
    assert memory.alpha_2[0] == controller.gains_floor[1], "the walk passed through the adaptation"

"""The paper's bounds against closed forms, the inequalities they come from, and the loops that they speak of."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.builders import arm, state, task
from hypothesis import given
from hypothesis import strategies as st

from hilrig.core.signals import Array
from hilrig.kinds.controllers._delay_bound import (
    PAPER_NU,
    ErrorDynamics,
    best_delay_bound,
    delay_bound,
    error_dynamics,
    gamma,
    lyapunov_matrix,
)
from hilrig.kinds.controllers._inertia_window import estimation_mismatch, highest_ratio, inertia_ratios, lowest_ratio
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.loop.control import filter_velocity

gains = st.floats(1.0, 500.0)
axes = st.integers(1, 4)
seeds = st.integers(0, 2**32 - 1)
PAPER = error_dynamics(150.0, 30.0)


def positive_matrix(random: np.random.Generator, size: int) -> Array:
    root = random.normal(size=(size, size))
    return root @ root.T + 0.3 * np.eye(size)


def test_the_error_dynamics_are_those_of_the_paper() -> None:
    """e'' = -k_p e - k_d e', axis by axis."""
    kp, kd = np.array([150.0, 90.0]), np.array([30.0, 20.0])
    a = error_dynamics(kp, kd, 2).undelayed
    e, rate = np.array([0.1, -0.2]), np.array([0.3, 0.4])
    np.testing.assert_allclose(a @ [*e, *rate], [*rate, *(-kp * e - kd * rate)])
    np.testing.assert_array_equal(error_dynamics(kp, kd, 2).input.T @ [1, 2, 3, 4], [3, 4])


@given(kp=gains, kd=gains, m=axes)
def test_p_has_the_closed_form_of_the_law(kp: float, kd: float, m: int) -> None:
    robot = arm()
    at_rest = state(robot, np.array([0.4, 1.3]), np.zeros(2))
    law = TdeSlidingMode(position_gain=kp, velocity_gain=kd).start(task(robot), at_rest).parameters
    p11 = kp * law.p22 + kd * law.p12
    closed = np.kron([[p11, law.p12], [law.p12, law.p22]], np.eye(m))
    np.testing.assert_allclose(lyapunov_matrix(error_dynamics(kp, kd, m).undelayed), closed, rtol=1e-8, atol=1e-12)


@given(seed=seeds, m=axes)
def test_p_solves_the_lyapunov_equation_for_any_weight(seed: int, m: int) -> None:
    random = np.random.default_rng(seed)
    a = error_dynamics(random.uniform(1, 200, m), random.uniform(1, 50, m), m).undelayed
    q = positive_matrix(random, 2 * m)
    p = lyapunov_matrix(a, q)
    np.testing.assert_allclose(a.T @ p + p @ a, -q, rtol=1e-6, atol=1e-7 * np.abs(p).max())
    assert np.linalg.eigvalsh(p)[0] > 0


@pytest.mark.parametrize(
    ("kp", "kd", "q", "words"),
    [
        (-150.0, -30.0, None, r"not Hurwitz: it has the eigenvalue 34.36\+0j"),
        (150.0, 0.0, None, "not Hurwitz: it has the eigenvalue 0"),
        (150.0, 30.0, np.diag([1.0, -2.0]), "not positive definite: it has the eigenvalue -2"),
        (150.0, 30.0, np.array([[1.0, 0.5], [0.0, 1.0]]), "Q is not symmetric"),
    ],
)
def test_what_has_no_p_is_refused(kp: float, kd: float, q: Array | None, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        lyapunov_matrix(error_dynamics(kp, kd).undelayed, q)


def on_ellipsoid(vector: Array, p: Array, size: float) -> Array:
    """Return `vector` scaled to E^T P E = size."""
    return vector * np.sqrt(size / (vector @ p @ vector))


def integrand(d: ErrorDynamics, p: Array, e: Array, past: Array, older: Array, h: Array) -> float:
    """Return -E^T P A_2 {A_1 E(t+r) + A_2 E(t+r-l) + B_o H(t+r)}, what (19) integrates over the delay."""
    return float(-e @ p @ d.delayed @ (d.present @ past + d.delayed @ older + d.input @ h))


@given(seed=seeds, kappa=st.floats(1e-3, 1.0), m=st.integers(1, 2))
def test_gamma_bounds_the_delayed_terms(seed: int, kappa: float, m: int) -> None:
    """integrand <= E^T Gamma E / 2 + H^T B^T P B H/(2 kappa), with E^T P E earlier up to nu times that of now."""
    random, d, nu = np.random.default_rng(seed), error_dynamics(150.0, 30.0, m), PAPER_NU
    p = lyapunov_matrix(d.undelayed)
    e, h = random.normal(size=2 * m), random.normal(size=m)
    past, older = (on_ellipsoid(random.normal(size=2 * m), p, nu * (e @ p @ e)) for _ in range(2))
    limit = e @ gamma(d, p, "derived", nu, kappa) @ e / 2 + h @ d.input.T @ p @ d.input @ h / (2 * kappa)
    assert integrand(d, p, e, past, older, h) <= limit * (1 + 1e-12)


@given(seed=seeds)
def test_no_smaller_factor_than_kappa_would_do(seed: int) -> None:
    """For the worst past, Young's inequality is an equality at the kappa that balances it; H and E_2l alike."""
    random, kappa = np.random.default_rng(seed), 0.08
    p = lyapunov_matrix(PAPER.undelayed)
    e = random.normal(size=2)
    worst = [-kappa * np.linalg.solve(p, x.T @ PAPER.delayed.T @ p @ e) for x in (PAPER.present, PAPER.delayed)]
    free = -kappa * np.linalg.solve(p, PAPER.delayed.T @ p @ e)  # in place of B_o H
    reached = -e @ p @ PAPER.delayed @ (PAPER.present @ worst[0] + PAPER.delayed @ worst[1] + free)
    halves = sum(v @ p @ v for v in (*worst, free)) / (2 * kappa)
    second = gamma(PAPER, p, "derived", 1.0, kappa) - 2 / kappa * p
    assert reached == pytest.approx(e @ second @ e / 2 + halves, rel=1e-9)


def test_the_papers_numbers() -> None:
    assert delay_bound(PAPER) == pytest.approx(0.750e-3, abs=5e-7)
    assert delay_bound(PAPER, "printed") == pytest.approx(0.0598e-3, abs=5e-8)
    assert delay_bound(PAPER, kappa=0.018) == pytest.approx(2.82e-3, abs=5e-6)
    best = best_delay_bound(PAPER)
    assert (best.kappa, best.delay) == pytest.approx((0.01776, 2.820e-3), rel=1e-3)


@given(kp=gains, kd=gains, m=st.integers(2, 4), scale=st.floats(0.1, 10.0))
def test_neither_more_axes_nor_a_larger_weight_change_the_bound(kp: float, kd: float, m: int, scale: float) -> None:
    one = delay_bound(error_dynamics(kp, kd))
    assert delay_bound(error_dynamics(kp, kd, m)) == pytest.approx(one, rel=1e-6)
    assert delay_bound(error_dynamics(kp, kd), q=scale * np.eye(2)) == pytest.approx(one, rel=1e-6)


@given(kp=gains, kd=gains, low=st.floats(1.0, 2.0), more=st.floats(1.001, 2.0))
def test_a_larger_nu_leaves_less_delay(kp: float, kd: float, low: float, more: float) -> None:
    d = error_dynamics(kp, kd)
    assert delay_bound(d, nu=low * more) < delay_bound(d, nu=low)
    assert delay_bound(d, "printed", kappa=0.08) < delay_bound(d, "printed", kappa=0.08 * more)


@given(kp=gains, kd=gains, m=st.integers(1, 2), factor=st.floats(1e-4, 1e4))
def test_no_other_kappa_beats_the_best(kp: float, kd: float, m: int, factor: float) -> None:
    d = error_dynamics(kp, kd, m)
    best = best_delay_bound(d)
    assert delay_bound(d, kappa=best.kappa) == pytest.approx(best.delay, rel=1e-9)
    assert delay_bound(d, kappa=best.kappa * factor) <= best.delay * (1 + 1e-9)


@given(seed=seeds, kp=gains, kd=gains, nu=st.floats(1.0, 2.0), factor=st.floats(0.5, 2.0))
def test_a_weight_of_any_shape_counts_by_its_least_eigenvalue(
    seed: int, kp: float, kd: float, nu: float, factor: float
) -> None:
    """(24) itself, lambda_min(Q)/|Gamma|, for a Q that is no multiple of the identity; its best kappa has no better."""
    d, q = error_dynamics(kp, kd), positive_matrix(np.random.default_rng(seed), 2)
    size = np.linalg.norm(gamma(d, lyapunov_matrix(d.undelayed, q), nu=nu, kappa=0.05), 2)
    assert delay_bound(d, nu=nu, kappa=0.05, q=q) == pytest.approx(np.linalg.eigvalsh(q).min() / size)
    best = best_delay_bound(d, nu, q)
    assert delay_bound(d, nu=nu, kappa=best.kappa, q=q) == pytest.approx(best.delay, rel=1e-9)
    assert delay_bound(d, nu=nu, kappa=best.kappa * factor, q=q) <= best.delay * (1 + 1e-9)


@pytest.mark.parametrize(("nu", "kappa", "words"), [(0.9, 0.08, "nu = 0.9"), (1.006, 0.0, "kappa = 0")])
def test_constants_that_the_proof_excludes_are_refused(nu: float, kappa: float, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        delay_bound(PAPER, nu=nu, kappa=kappa)


@given(seed=seeds, m=axes)
def test_mismatch_and_ratios_are_those_of_the_inverse_inertia(seed: int, m: int) -> None:
    random = np.random.default_rng(seed)
    inertia, estimate = np.array([positive_matrix(random, m) for _ in range(3)]), random.uniform(0.01, 2.0, m)
    inverse = np.linalg.inv(inertia)
    for k in range(3):
        matrix = np.linalg.solve(inertia[k], np.diag(estimate))
        largest = np.sqrt(np.linalg.eigvalsh((matrix - np.eye(m)).T @ (matrix - np.eye(m)))[-1])
        assert estimation_mismatch(inverse, estimate)[k] == pytest.approx(largest, rel=1e-7)
        eigenvalues = np.sort(np.linalg.eigvals(matrix).real)
        np.testing.assert_allclose(inertia_ratios(inverse, estimate)[k], eigenvalues, rtol=1e-6, atol=1e-9)


def test_condition_9_is_the_edge_without_delay_where_mhat_is_a_number() -> None:
    inverse = np.linalg.inv([[1.6, -0.45], [-0.45, 0.53]])
    least = 1 / np.linalg.eigvalsh(inverse)[-1]
    for share, kept in ((0.99, True), (1.01, False)):
        mhat = np.full(2, share * highest_ratio(0) * least)
        assert (estimation_mismatch(inverse, mhat) < 1) == kept


def test_condition_9_is_not_necessary_where_mhat_differs_between_axes() -> None:
    inverse, mhat = np.linalg.inv([[1.6075, -0.4557], [-0.4557, 0.532]]), np.array([0.3, 0.02])
    assert estimation_mismatch(inverse, mhat) > 1
    assert inertia_ratios(inverse, mhat)[-1] < highest_ratio(1, 0.467)


def largest_growth(ratio: float, delay: int, smoothing: float | None) -> float:
    """Return how an estimation loop of one axis, M_t = 1, ends: its torque late over its torque early.

    tau_k = tau_(k-1) - Mhat x''_k on a point mass, sampled exactly, with hilrig's own velocity filter.
    """
    steps = 4000
    torque, q, rate, last_q = [1.0], np.zeros(1), 0.0, np.zeros(1)
    filtered, before, applied = np.zeros(1), 0.0, 0.0
    for k in range(steps):
        filter_velocity(filtered, q, last_q, 1.0, smoothing or 1.0)
        acceleration = applied if smoothing is None else filtered[0] - before
        before, last_q = float(filtered[0]), q.copy()
        torque.append(torque[-1] - ratio * acceleration)
        applied = torque[k + 1 - delay] if k >= delay else 0.0
        q, rate = q + rate + applied / 2, rate + applied
    return float(np.abs(torque[-200:]).max() / np.abs(torque[:200]).max())


@pytest.mark.parametrize("delay", [0, 1, 2, 4])
@pytest.mark.parametrize("smoothing", [None, 1.0, 0.467, 0.2])
def test_the_estimation_loop_is_stable_below_the_upper_edge_and_not_above(delay: int, smoothing: float | None) -> None:
    edge = highest_ratio(delay, smoothing)
    assert largest_growth(0.96 * edge, delay, smoothing) < 0.1
    assert largest_growth(1.04 * edge, delay, smoothing) > 10


def test_the_upper_edge_in_closed_form() -> None:
    assert [highest_ratio(d) for d in (0, 1)] == pytest.approx([2.0, 1.0])
    assert [highest_ratio(d, 1.0) for d in (0, 1, 2)] == pytest.approx(
        [2 * np.tan(np.pi / (4 * (d + 1))) for d in range(3)]
    )
    assert [highest_ratio(0, a) for a in (0.1, 0.5, 0.9)] == pytest.approx([2.0] * 3)


@pytest.mark.parametrize(
    ("delay", "smoothing", "words"), [(-1, None, "-1 samples"), (1, 0.0, "smoothing = 0"), (1, 1.5, "1.5")]
)
def test_a_loop_that_cannot_be_is_refused(delay: int, smoothing: float | None, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        highest_ratio(delay, smoothing)


def test_the_lower_edge_is_that_of_the_stiffest_axis() -> None:
    assert lowest_ratio(1e-3, 150.0, 30.0) == pytest.approx(0.01)
    assert lowest_ratio(1e-3, np.array([150.0, 300.0]), np.array([30.0, 30.0])) == pytest.approx(0.02)

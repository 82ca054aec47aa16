"""The delay bound (24) for a law with time delay estimation: error dynamics (13), Lyapunov matrix and Gamma (21)."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import scipy.linalg
import scipy.optimize

from hilrig.core.signals import Array

PAPER_NU = 1.006
"""The paper's constant in Razumikhin's condition, Section V"""
PAPER_KAPPA = 0.08
"""The paper's free scalar in (21), Section V"""

BoundForm = Literal["derived", "printed"]
Gain = float | Array
"""One number for all axes, or one per axis, (m,)"""


class ErrorDynamics(NamedTuple):
    """E' = A_1 E + A_2 E_l + B_o (S_c - u_r^l), eq. (13), with E = [p_d - x, v_d - x'] (2m,) and E_l = E(t - l)."""

    present: Array
    """A_1 = [[0, I], [0, 0]], (2m, 2m)"""
    delayed: Array
    """A_2 = [[0, 0], [-k_p, -k_d]], (2m, 2m); the paper prints k_d first, which does not match its E"""
    input: Array
    """B_o = [0; I], (2m, m)"""

    @property
    def undelayed(self) -> Array:
        """A_o = A_1 + A_2, (2m, 2m): the dynamics at zero delay."""
        return self.present + self.delayed


def error_dynamics(position_gain: Gain, velocity_gain: Gain, axes: int = 1) -> ErrorDynamics:
    """Return the error dynamics for k_p (1/s^2) and k_d (1/s) with m = `axes`."""
    zero, one = np.zeros((axes, axes)), np.eye(axes)
    kp, kd = np.diag(np.broadcast_to(position_gain, axes)), np.diag(np.broadcast_to(velocity_gain, axes))
    present, delayed = np.block([[zero, one], [zero, zero]]), np.block([[zero, zero], [-kp, -kd]])
    return ErrorDynamics(present, delayed, np.vstack([zero, one]))


def lyapunov_matrix(a: Array, q: Array | None = None) -> Array:
    """Return P_o > 0 with A^T P + P A = -Q; Q defaults to the identity.

    Raises ValueError, naming the eigenvalue, if A is not Hurwitz or Q is not symmetric and positive definite.
    """
    weight = np.eye(a.shape[0]) if q is None else np.asarray(q, dtype=np.float64)
    if not np.allclose(weight, weight.T):
        raise ValueError("Q is not symmetric")
    if (least := float(np.linalg.eigvalsh(weight)[0])) <= 0.0:
        raise ValueError(f"Q is not positive definite: it has the eigenvalue {least:.4g}")
    eigenvalues = np.linalg.eigvals(a)
    worst = complex(eigenvalues[np.argmax(eigenvalues.real)])
    if worst.real >= 0.0:
        raise ValueError(f"A_o is not Hurwitz: it has the eigenvalue {worst.real:.4g}{worst.imag:+.4g}j 1/s")
    p = scipy.linalg.solve_continuous_lyapunov(a.T, -weight)
    return (p + p.T) / 2


def delay_terms(dynamics: ErrorDynamics, p: Array) -> Array:
    """Return P A_2 (P^-1 + A_1 P^-1 A_1^T + A_2 P^-1 A_2^T) A_2^T P, (2m, 2m): the second term of (21)."""
    a1, a2 = dynamics.present, dynamics.delayed
    inverse = np.linalg.inv(p)
    left = p @ a2
    return left @ (inverse + a1 @ inverse @ a1.T + a2 @ inverse @ a2.T) @ left.T


def gamma(
    dynamics: ErrorDynamics, p: Array, form: BoundForm = "derived", nu: float = PAPER_NU, kappa: float = PAPER_KAPPA
) -> Array:
    """Return Gamma of (21), (2m, 2m) 1/s:  2 nu/kappa P + c P A_2 (P^-1 + A_1 P^-1 A_1^T + A_2 P^-1 A_2^T) A_2^T P.

    c = nu as printed, c = kappa as derived. Derivation: Young's inequality,
    -a^T b <= (kappa a^T P^-1 a + b^T P b/kappa)/2, bounds each of the three integrands
    E^T P A_2 {A_1 E(t+r), A_2 E(t+r-l), B_o H(t+r)} of (19). Its first half gives
    l kappa E^T P A_2 X P^-1 X^T A_2^T P E / 2 with X = A_1, A_2, I: the terms that the paper itself has above (20).
    Its second half is at most l nu/kappa E^T P E / 2 for the first two, by Razumikhin's condition (17), and goes into
    Upsilon_1 for the third. The sum is (l/2) E^T Gamma E with kappa in both places.

    Raises ValueError unless nu >= 1 and kappa > 0.
    """
    if not nu >= 1.0:
        raise ValueError(f"nu = {nu:g}; Razumikhin's condition needs at least 1")
    if not kappa > 0.0:
        raise ValueError(f"kappa = {kappa:g}; it must be above 0")
    return 2 * nu / kappa * p + (nu if form == "printed" else kappa) * delay_terms(dynamics, p)


def delay_bound(
    dynamics: ErrorDynamics,
    form: BoundForm = "derived",
    nu: float = PAPER_NU,
    kappa: float = PAPER_KAPPA,
    q: Array | None = None,
) -> float:
    """Return lambda_min(Q_o)/|Gamma|_2 of (24), s: Proposition 1 holds for delays l below it.

    It is sufficient for V in the proof to decrease, and says nothing about longer delays: a Razumikhin bound is
    conservative.
    Raises ValueError as `lyapunov_matrix` and `gamma` do.
    """
    p = lyapunov_matrix(dynamics.undelayed, q)
    least = 1.0 if q is None else float(np.linalg.eigvalsh(q)[0])
    return least / float(np.linalg.norm(gamma(dynamics, p, form, nu, kappa), 2))


class BestBound(NamedTuple):
    """The largest delay bound that a choice of kappa gives."""

    kappa: float
    delay: float
    """s"""


def best_delay_bound(dynamics: ErrorDynamics, nu: float = PAPER_NU, q: Array | None = None) -> BestBound:
    """Return the kappa at which the derived bound (24) is largest, and that bound.

    |2 nu/kappa P + kappa N|_2 is convex in log kappa. With c = sqrt(2 nu |P|/|N|) it is at most 2 sqrt(2 nu |P| |N|) at
    c, and larger outside [c/2, 2c], so the only minimum lies inside. The printed form has no minimum: it decreases with
    kappa. Raises ValueError as `lyapunov_matrix` does.
    """
    p = lyapunov_matrix(dynamics.undelayed, q)
    centre = 0.5 * np.log(2 * nu * np.linalg.norm(p, 2) / np.linalg.norm(delay_terms(dynamics, p), 2))
    found: Any = scipy.optimize.minimize_scalar(
        lambda log_kappa: float(np.linalg.norm(gamma(dynamics, p, nu=nu, kappa=np.exp(log_kappa)), 2)),
        bounds=(centre - np.log(2), centre + np.log(2)),
        method="bounded",
        options={"xatol": 1e-9},
    )
    least = 1.0 if q is None else float(np.linalg.eigvalsh(q)[0])
    return BestBound(float(np.exp(found.x)), least / float(found.fun))

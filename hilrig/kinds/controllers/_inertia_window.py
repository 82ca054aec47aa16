"""The window of Mhat in which a loop with time delay estimation is stable, and the paper's condition (9).

M_t = J^-T M J^-1 (m, m) is the arm's inertia along the task axes; Mhat (m,) kg is the law's diagonal estimate of M_t.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize

from hilrig.core.signals import Array
from hilrig.kinds.controllers._delay_bound import Gain


def estimation_mismatch(mobility: Array, inertia_estimate: Array) -> Array:
    """Return |M_t^-1 Mhat - I|_2 of condition (9) for M_t^-1 (..., m, m); it should be below 1.

    The paper needs it for a bounded S_c. For the sampled loop it is not sufficient: with Mhat = c I it requires
    c < 2 lambda_min(M_t), the edge of `highest_ratio` for d = 0, but one sample of delay puts the edge at less than
    half of that, and no small Mhat violates it. It is not necessary if Mhat differs between axes: M_t^-1 Mhat - I is
    then not symmetric, and its norm may be above 1 with eigenvalues well inside the unit circle.
    """
    difference = mobility * inertia_estimate - np.eye(inertia_estimate.size)
    return np.asarray(np.linalg.norm(difference, 2, axis=(-2, -1)), dtype=np.float64)


def inertia_ratios(mobility: Array, inertia_estimate: Array) -> Array:
    """Return the eigenvalues of M_t^-1 Mhat, ascending, (..., m); Mhat/lambda(M_t) if Mhat is the same in all axes.

    They are real and non-negative: the eigenvalues of the symmetric Mhat^1/2 M_t^-1 Mhat^1/2.
    """
    root = np.sqrt(inertia_estimate)
    return np.asarray(np.linalg.eigvalsh(root[:, None] * mobility * root), dtype=np.float64)


def highest_ratio(extra_samples: int, smoothing: float | None = None) -> float:
    """Return the value that the eigenvalues g of M_t^-1 Mhat must stay below for a stable estimation loop.

    d = `extra_samples` of delay between measurement and actuation. Without contact and outer loop the law is
    tau_k = tau_(k-1) - Mhat x''_k, where x''_k is its estimate of the acceleration:

    - `smoothing` None: the true acceleration in the previous period, tau_(k-1-d)/M_t. Then z^d (z - 1) = -g, a root
      leaves the unit circle at z = e^(i w) with d w + (pi + w)/2 = pi, and g = |z - 1| = 2 sin(pi/(2 (2d + 1))).
    - `smoothing` a: hilrig's estimate, the difference of q', which is filtered from differences of q,
      q' += a ((q - q_prev)/l - q'). A difference of positions is the mean velocity of its period: half a period older.
      Then z^d (z - 1)(z - 1 + a) = -(g a/2)(z + 1), so d w + arg(z - 1 + a) = pi/2, g = 2/a tan(w/2) |z - 1 + a|.

    Both are 2 for d = 0 and any a; for d = 1 the first is 1, the second 0.83 for a = 1 and 0.68 for a -> 0.
    Raises ValueError unless d >= 0 and 0 < a <= 1.
    """
    if extra_samples < 0:
        raise ValueError(f"{extra_samples} samples of delay; it must be at least 0")
    if smoothing is None:
        return float(2 * np.sin(np.pi / (2 * (2 * extra_samples + 1))))
    if not 0.0 < smoothing <= 1.0:
        raise ValueError(f"smoothing = {smoothing:g}; it must be above 0 and at most 1")
    pole = 1.0 - smoothing

    def angle(w: float) -> float:
        return extra_samples * w + np.arctan2(np.sin(w), np.cos(w) - pole) - np.pi / 2

    w = float(scipy.optimize.brentq(angle, 0.0, np.pi, xtol=1e-14))  # pyright: ignore[reportArgumentType]
    return float(2 / smoothing * np.tan(w / 2) * np.hypot(np.sin(w), np.cos(w) - pole))


def lowest_ratio(period: float, position_gain: Gain, velocity_gain: Gain) -> float:
    """Return 2 l k_p/k_d, the largest over the axes; the eigenvalues of M_t^-1 Mhat should stay above it.

    Empirical: limit cycles were seen below it; the factor 2 was found by simulation, and no proof is known.
    """
    return float(np.max(2 * period * np.asarray(position_gain) / np.asarray(velocity_gain)))

"""The proposed law in plain NumPy, written a second time from the equations, misprints included."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
import scipy.linalg

from helpers.builders import PERIOD, arm, impedance, state, task
from hilrig.core.interfaces import Impedance
from hilrig.core.signals import Array, Reference, State
from hilrig.kinds.controllers import tde_sliding_mode
from hilrig.kinds.controllers.tde_sliding_mode import Memory, TdeSlidingMode

ARM = arm()
Q = np.array([0.4, 1.3])
OTHER_NUMBERS = {
    "inertia_estimate": (0.05, 0.02), "position_gain": 90.0, "velocity_gain": 20.0, "robust_gain": 2.0,
    "boundary": 0.003, "gains_start": (0.5, 0.8, 0.9), "gains_floor": (0.002, 0.3, 0.7),
}  # fmt: skip


def alphas(memory: Memory) -> Array:
    return np.concatenate([memory.alpha_1, memory.alpha_2, memory.alpha_3])


def adapting(
    controller: TdeSlidingMode,
    xi: Callable[[float], Array],
    duration: float = 1.2,
    adapt: Callable[..., None] = tde_sliding_mode.adapt,
) -> Array:
    """Return (t, alpha_1, alpha_2, alpha_3) at every tick, (N, 4), for a given xi(t)."""
    law = controller.start(task(ARM), state(ARM, Q, np.zeros(2)))
    rows = []
    for k in range(1, round(duration / PERIOD) + 1):
        now = xi(k * PERIOD)
        outward = now @ (now - law.memory.sliding_variable) > 0
        adapt(law.parameters, law.memory, PERIOD, float(np.linalg.norm(now)), bool(outward))
        law.memory.sliding_variable[:] = now
        rows.append([k * PERIOD, *alphas(law.memory)])
    return np.array(rows)


def tde_again(s: dict, now: State, wanted: Reference, desired: Impedance) -> Array:
    """Take one step of the law; `s` holds its memory and its misprints."""
    law, elapsed, misprints = s["law"], now.elapsed, s["misprints"]
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
    falls = not rises
    if "adaptation" in misprints:
        falls = not rises and not growing and a2 <= floor_2 and a3 <= floor_3
    new_1 = a1 + elapsed * law.growth * n if rises else max(a1 - elapsed * law.decay * n, 0.0) if falls else a1
    new_3 = max(a3 - elapsed * n / a3, floor_3) if a3 > floor_3 else a3
    new_2 = max(a2 - elapsed / a2, floor_2) if a2 > floor_2 else a2
    s["alpha"], s["xi"] = np.array([new_1, new_2, new_3]), xi
    sign = -1 if "feedback" in misprints else 1
    smooth = np.tanh(xi / law.boundary)
    robust = smooth if "switching" not in misprints else np.tanh(xi) if n > law.boundary else xi / law.boundary
    u = a_d + sign * (kd * e_rate + kp * e) + law.robust_gain * s["alpha"].sum() * robust
    acceleration = s["a_d"] if "estimator" in misprints else (now.velocity - s["xd"]) / elapsed
    held = now.torque if s["started"] or law.preload else np.zeros(2)
    before = np.linalg.inv(now.jacobian).T @ held - mhat * acceleration
    s["xd"], s["a_d"], s["started"] = now.velocity, a_d, True
    return now.jacobian.T @ (mhat * u + before)


def compared(controller: TdeSlidingMode, misprints: Collection[str] = ()) -> tuple[Memory, float]:
    """Take a random walk with the law and with the law written again, misprints included; every torque is the same.

    Returns the law's memory at the end and the largest |xi| on the way.
    """
    rng = np.random.default_rng(3)
    start = state(ARM, Q, np.array([0.3, -0.4]), torque=np.array([1.0, 2.0]))
    law = controller.start(task(ARM), start)
    a = np.array([[0.0, 1.0], [-controller.position_gain, -controller.velocity_gain]])
    p = scipy.linalg.solve_continuous_lyapunov(a if "lyapunov" in misprints else a.T, -np.eye(2))
    again = {
        "law": controller,
        "misprints": misprints,
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
    return law.memory, float(max(sizes))

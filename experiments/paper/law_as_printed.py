"""The paper's law with its misprints, one option each. docs/paper.md says what each of them does.

This file contains only the misprints. The rest is `tde_sliding_mode`: its kernels are compiled again, each with a
misprint instead of the function that it replaces.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from hilrig import Array, Assessment, Law, Parameter, Setting, State, Task, kernel_without_arrays
from hilrig.core.compiler import composed
from hilrig.kinds.controllers import tde_sliding_mode as as_read
from hilrig.kinds.controllers.tde_sliding_mode import Constants, Memory, TdeSlidingMode, adapt


@dataclass(frozen=True)
class LawAsPrinted(TdeSlidingMode):
    """tau = J^T [Mhat u + S_hat] of `tde_sliding_mode`, with the printed forms instead of hilrig's reading:

    estimator = desired:    S_hat = J^-T tau_l - Mhat a_d,l, the desired acceleration one period ago;
    lyapunov = transposed:  P solves A P + P A^T = -I: p12 = -1/2, p22 = (1 + k_p)/(2 k_d);
    feedback = positive:    u has -k_d e' - k_p e; P stays that of k_d, k_p > 0;
    switching = printed:    xi / mu while |xi| <= mu, tanh(xi) beyond, instead of tanh(xi / mu);
    adaptation = printed:   alpha_1 falls only while xi moves inward and alpha_2, alpha_3 are at their floors.

    Source: paper eqs. (8), (10), (11), (15), and P_o in Section V.
    """

    estimator: Annotated[Literal["measured", "desired"], Parameter("", "acceleration in S_hat")] = "measured"
    lyapunov: Annotated[Literal["solved", "transposed"], Parameter("", "equation that P solves")] = "solved"
    feedback: Annotated[Literal["negative", "positive"], Parameter("", "of k_p e + k_d e'")] = "negative"
    switching: Annotated[Literal["smooth", "printed"], Parameter("", "robust term at its boundary")] = "smooth"
    adaptation: Annotated[Literal["complete", "printed"], Parameter("", "cases of alpha_1'")] = "complete"

    def start(self, task: Task, state: State) -> Law:
        """Return the law; it starts as `tde_sliding_mode` does."""
        law = super().start(task, state)
        gains = law.parameters
        if self.feedback == "positive":
            gains = gains._replace(position_gain=-self.position_gain, velocity_gain=-self.velocity_gain)
        return Law(self._step(), gains, law.memory)

    def assess(self, setting: Setting) -> Assessment:
        """Return no bounds: those of `tde_sliding_mode` hold for the law without misprints."""
        return Assessment(
            (), note="The bounds of tde_sliding_mode hold for the law without misprints; here none is known."
        )

    def surface_gains(self) -> tuple[float, float]:
        """Return p12 (s^2) and p22 (s) of xi = p12 e + p22 e', the second row of P."""
        if self.lyapunov == "transposed":
            return -0.5, (1 + self.position_gain) / (2 * self.velocity_gain)
        return super().surface_gains()

    def _step(self):
        """Return the step of `tde_sliding_mode` with the selected misprints."""
        parts = {}
        if self.estimator == "desired":
            parts["estimate"] = _with(as_read.estimate, last_acceleration=desired_acceleration)
        if self.adaptation == "printed":
            parts["slide"] = _with(as_read.slide, adapt=adapt_as_printed)
        if self.switching == "printed":
            parts["press"] = _with(as_read.press, switching=switching_as_printed)
        return composed(as_read.step.py_func, **parts) if parts else as_read.step


def _with(kernel, **parts):
    """Return a kernel of `tde_sliding_mode` with these kernels instead of those that it calls by the same names."""
    return composed(kernel.py_func, makes_arrays=False, **parts)


@kernel_without_arrays
def desired_acceleration(memory: Memory, state: State, i: int) -> float:
    """Return a_d of axis `i` one period ago, m/s^2: `memory` has that of the last tick until the filter moves on."""
    return memory.desired_acceleration[i]


@kernel_without_arrays
def adapt_as_printed(c: Constants, memory: Memory, elapsed: float, size: float, outward: bool) -> None:
    """Run `adapt`, and hold alpha_1 where the paper says neither that it rises nor that it falls."""
    alpha_1 = memory.alpha_1[0]
    above = memory.alpha_2[0] > c.gains_floor[1] or memory.alpha_3[0] > c.gains_floor[2]
    adapt(c, memory, elapsed, size, outward)
    if memory.alpha_1[0] < alpha_1 and (outward or above):
        memory.alpha_1[0] = alpha_1


@kernel_without_arrays
def switching_as_printed(c: Constants, xi: Array, i: int) -> float:
    """Return xi_i / mu while |xi| <= mu, and tanh(xi_i) beyond."""
    square = 0.0
    for j in range(xi.size):
        square += xi[j] * xi[j]
    return xi[i] / c.boundary if np.sqrt(square) <= c.boundary else np.tanh(xi[i])

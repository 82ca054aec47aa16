"""Robots that each break one rule: geometry whose derivatives disagree, models that are no mechanism."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers.rules import assert_noticed, assert_the_first_rule_alone, broken, changed

GOOD = '''
"""A robot of somebody's own: a turning arm with a sliding joint at its end."""
from dataclasses import dataclass
from typing import Annotated, ClassVar
import numpy as np
from hilrig import Kinematics, OutOfReach, Parameter, RobotKernels

@dataclass(frozen=True)
class Mine:
    """x = q2 cos q1, z = q2 sin q1; a mass m at the tip, theta = (m, b1, b2)."""

    axes: ClassVar[tuple[str, ...]] = ("x", "z")
    joints: ClassVar[int] = 2
    mass: Annotated[float, Parameter("kg", "of the tip", 0.01, 100)] = 2.0
    # field

    def forward_kinematics(self, q):
        return q[1] * np.array([np.cos(q[0]), np.sin(q[0])])

    def inverse_kinematics(self, position):
        reach = np.hypot(*position)
        # inverse
        if not 0.1 <= reach <= 2.0:
            raise OutOfReach(f"{reach:g} m is out of reach")
        return np.array([np.arctan2(position[1], position[0]), reach])

    def kinematics(self, q, rate):
        c, s, r = np.cos(q[0]), np.sin(q[0]), q[1]
        jacobian = np.array([[-r * s, c], [r * c, s]])
        a, b = -rate[1] * s - r * c * rate[0], rate[1] * c - r * s * rate[0]
        change = np.array([[a, -s * rate[0]], [b, c * rate[0]]])
        regressor = np.zeros((5, 2, 3))
        regressor[0, 0, 0], regressor[0, 1, 0] = 9.81 * r * c, 9.81 * s
        regressor[1, 0, 0], regressor[2, 0, 0] = r * rate[1], r * rate[0]
        regressor[1, 1, 0] = -r * rate[0]
        regressor[1, 0, 1] = regressor[2, 1, 2] = 1.0
        regressor[3, 0, 0], regressor[4, 1, 0] = r * r, 1.0
        position = self.forward_kinematics(q)
        # kinematics
        return Kinematics(position, jacobian @ rate, jacobian, change, regressor)

    def dynamic_parameters(self):
        return np.array([self.mass, 0.1, 0.2])

    def torque_limits(self):
        return np.array([50.0, 50.0])

    def joint_limits(self):
        return np.array([-3.0, 0.1]), np.array([3.0, 2.0])

    # method
'''
BUFFER = "Mine.room = getattr(Mine, 'room', jacobian.copy()); Mine.room[:] = jacobian; jacobian = Mine.room"
WRONG_KERNEL = """
    def kernels(self):
        def fill(constants, q, rate, at):
            for part, wanted in zip(at, self.kinematics(q, rate)):
                part[:] = wanted * (1 + 1e-15)
        return RobotKernels(fill, None)
"""

FAULTS = {
    "sizes_agree": ({"kinematics": "regressor = regressor[:, :, :2]"}, "kinematics.regressor is an array (5, 2, 2)"),
    "sizes_agree single": ({"kinematics": "jacobian = jacobian.astype(np.float32)"}, "is an array of float32"),
    "sizes_agree limits": (
        {"method": "def torque_limits(self): return [50.0, 50.0]"}, "torque_limits is a list",
    ),
    "inverse_kinematics_reaches_the_position": ({"inverse": "reach += 1e-3"}, "asked for ["),
    "what_is_out_of_reach_is_refused": (
        {"inverse": "reach = min(reach, 2.0)"}, "for a place 1e+06 m away it returned [",
    ),
    "what_is_out_of_reach_is_refused value": (
        {"inverse": "assert reach < 3, 'far'"}, "it raised AssertionError: far (line ",
    ),
    "kinematics_agree_with_the_position": ({"kinematics": "position = position + 1e-6"}, "m by the other"),
    "the_jacobian_is_the_derivative_of_the_position": ({"kinematics": "jacobian[0, 0] *= -1"}, "its Jacobian is [["),
    "the_jacobians_rate_is_its_derivative": ({"kinematics": "change[1, 1] = 0.0"}, "the Jacobian's rate is [["),
    "inertia_is_symmetric_and_positive": ({"kinematics": "regressor[3, 1, 0] = 0.3"}, "M is [["),
    "inertia_is_symmetric_and_positive sign": (
        {"kinematics": "regressor[4, 1, 0] = -1.0"}, "its smallest eigenvalue is -",
    ),
    "coriolis_forces_fit_the_inertia": ({"kinematics": "regressor[1, 1, 0] = 0.0"}, "for v = ["),
    "coriolis_forces_fit_the_inertia energy kept": (
        {"kinematics": "regressor[1, 0, 0] = 2 * r * rate[1]; regressor[2, 0, 0] = 0"}, "for v = [",
    ),
    "gravity_has_a_potential": ({"kinematics": "regressor[0, 1, 0] *= -1"}, "dG/dq is [["),
    "friction_takes_energy": ({"kinematics": "regressor[1, 0, 1] = -1.0"}, "it gives "),
    "inputs_are_only_read_and_outputs_the_callers_own": (
        {"kinematics": BUFFER}, "kinematics.jacobian of one call was changed by the next",
    ),
    "inputs_are_only_read_and_outputs_the_callers_own input": (
        {"kinematics": "rate *= 1.0001"}, "changed the joints' state",
    ),
    "inputs_are_only_read_and_outputs_the_callers_own limits": (
        {"method": "LIMITS = np.array([50.0, 50.0])\n    def torque_limits(self): return self.LIMITS"},
        "what torque_limits returned before, changed by its owner, came again",
    ),
    "kernels_give_the_same_bits": ({"method": WRONG_KERNEL}, "instead of"),
}  # fmt: skip


def test_a_good_robot_keeps_every_rule(tmp_path: Path) -> None:
    assert broken("robots", GOOD, tmp_path) == {}


def test_a_robot_without_a_model_keeps_every_rule_that_there_is_for_it(tmp_path: Path) -> None:
    without = "def dynamic_parameters(self): return np.zeros(0)"
    source = changed(GOOD, method=without, kinematics="regressor = np.zeros((5, 2, 0))")
    assert broken("robots", source, tmp_path) == {}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_noticed_and_told(tmp_path: Path, fault: str) -> None:
    replacements, words = FAULTS[fault]
    assert_noticed("robots", changed(GOOD, **replacements), tmp_path, fault.split()[0], words)


def test_an_exception_is_told_once(tmp_path: Path) -> None:
    words = "it raised ZeroDivisionError: division by zero (line "
    assert_the_first_rule_alone("robots", changed(GOOD, kinematics="1 / 0"), tmp_path, "sizes_agree", words)

"""A trial of the proposed law whose bounds are known, and their names."""

from __future__ import annotations

from typing import Any

import numpy as np

from helpers.builders import trial
from hilrig.experiment.trial import PhaseSpec, Trial
from hilrig.kinds.controllers.tde_sliding_mode import TdeSlidingMode
from hilrig.kinds.references.hold import Hold
from hilrig.kinds.references.sine import Sine
from hilrig.kinds.robots.planar_2r import Planar2r

PRINTED = "delay bound (24), as printed (nu)"
DERIVED = "delay bound (24), as derived (kappa)"
BEST = "delay bound (24), as derived, best kappa"
LOWER, UPPER = "Mhat, lower edge (empirical)", "Mhat, upper edge"
MISMATCH = "condition (9), |M_t⁻¹ Mhat − I|"


def estimating(**changes: Any) -> Trial:
    """Return a trial of the proposed law that swings along the rail."""
    phases = (PhaseSpec("swing", 0.0, 2.0, {"x": Sine(0.3, 3.0)}, {"z": Hold(3.5)}),)
    plain = {"controller": TdeSlidingMode(), "phases": phases, "start_position": (0.0, 0.35)}
    return trial(**{**plain, **changes})


def tip_inertia(robot: Planar2r, x: float, z: float) -> np.ndarray:
    """Return M_t (2, 2) kg at a place, from the joint torques of unit accelerations."""
    at = robot.kinematics(robot.inverse_kinematics(np.array([x, z])), np.zeros(2))
    mass = np.stack([at.regressor[3 + i] @ robot.dynamic_parameters() for i in range(2)], axis=1)
    inverse = np.linalg.inv(at.jacobian)
    return inverse.T @ mass @ inverse

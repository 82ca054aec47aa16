"""Every kind that is found keeps the rules of its group, those of `hilrig.testing`."""

from __future__ import annotations

from helpers.builders import arm, surface

from hilrig.kinds.actuation import Actuation
from hilrig.testing import contract

ROUGH = {"robot": arm(), "surface": surface(friction=0.3), "coulomb": (0.05, 0.05), "viscous": (0.02, 0.02)}
"""A plant with friction everywhere, so that its disturbances show"""

test_controllers = contract("controllers")
test_references = contract("references")
test_disturbances = contract("disturbances", factor=2.0, ticks=3, force=0.5, joint=1e-3, at=0.5, duration=0.5)
test_robots = contract("robots")
test_drivers = contract("drivers", **ROUGH)
test_drivers_with_a_servo = contract("drivers", **ROUGH, actuation=Actuation("position_servo", stiffness=60.0))
test_metrics = contract("metrics")

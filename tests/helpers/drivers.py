"""The drivers that come with hilrig, as parameters of tests."""

from __future__ import annotations

import pytest
from hilrig_drivers.pybullet_arm import PybulletArm
from hilrig_drivers.two_link import TwoLink

from hilrig.kinds.registry import kind_names

PYBULLET = pytest.param(PybulletArm, marks=pytest.mark.needs_pybullet, id="pybullet_arm")
DRIVERS = [pytest.param(TwoLink, id="two_link"), PYBULLET]
KINDS = [
    pytest.param(kind, marks=[pytest.mark.needs_pybullet] if kind == "pybullet_arm" else [])
    for kind in kind_names("drivers")
]

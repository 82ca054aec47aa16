from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hilrig.kinds.contact import FRICTION_SPEED, SurfaceState, contact_force

STIFFNESS, DAMPING, FRICTION = 800.0, 20.0, 0.2
depths = st.floats(-0.05, 0.05)
speeds = st.floats(-1.0, 1.0)


def at(depth: float, rate: float = 0.0, slip: float = 0.0, **changes: float) -> tuple[float, float]:
    """Return (normal, tangential) at a depth below a surface at 0.35 m."""
    plain = SurfaceState(0.35, 0.0, STIFFNESS, DAMPING, FRICTION, False)
    return contact_force(plain._replace(**changes), 0.35 + depth, rate, slip)


@given(force=st.floats(0.01, 100.0))
def test_at_rest_the_depth_is_force_over_stiffness(force: float) -> None:
    assert at(force / STIFFNESS)[0] == pytest.approx(force, rel=1e-9)


@given(depth=depths, rate=speeds, slip=speeds)
def test_a_surface_does_not_pull(depth: float, rate: float, slip: float) -> None:
    assert at(depth, rate, slip)[0] >= 0.0


@given(depth=st.floats(-0.05, 0.0), rate=speeds, slip=speeds)
def test_no_force_without_penetration(depth: float, rate: float, slip: float) -> None:
    assert at(depth, rate, slip) == (0.0, 0.0)


@given(depth=depths, rate=speeds)
def test_a_surface_that_pulls_follows_the_formula_everywhere(depth: float, rate: float) -> None:
    assert at(depth, rate, pulls=True)[0] == pytest.approx(STIFFNESS * depth + DAMPING * rate, abs=1e-9)


@given(depth=depths, rate=speeds, slip=speeds, pulls=st.booleans())
def test_friction_resists_sliding_and_is_bounded(depth: float, rate: float, slip: float, pulls: bool) -> None:
    """F is what the robot exerts: it drags the surface along its own motion, so F_t slip >= 0 takes energy from it."""
    normal, tangential = at(depth, rate, slip, pulls=pulls)
    assert tangential * slip >= 0.0
    assert abs(tangential) <= FRICTION * abs(normal)


def test_friction_is_full_beyond_its_speed_and_linear_below() -> None:
    normal, full = at(0.01, slip=2 * FRICTION_SPEED)
    assert full == pytest.approx(FRICTION * normal)
    assert at(0.01, slip=-0.5 * FRICTION_SPEED)[1] == pytest.approx(-0.5 * FRICTION * normal)


@given(depth=depths, slip=speeds)
def test_force_at_rest_is_continuous(depth: float, slip: float) -> None:
    """A millionth of a metre or of a metre per second more changes the force by no more than slope times that."""
    here, step = at(depth, slip=slip), 1e-6
    deeper, faster = at(depth + step, slip=slip), at(depth, slip=slip + step)
    assert abs(deeper[0] - here[0]) <= STIFFNESS * step * 1.001
    assert abs(faster[1] - here[1]) <= FRICTION * here[0] / FRICTION_SPEED * step * 1.001


def test_damping_counts_from_the_surfaces_own_velocity() -> None:
    assert at(0.01, rate=0.1, velocity=0.1)[0] == pytest.approx(at(0.01)[0])
    assert at(0.01, velocity=-0.1)[0] == pytest.approx(8.0 + DAMPING * 0.1)

"""Mechanics of two rods, independent of hilrig: each rod is a set of point masses that has the rod's mass moments.

A rod of mass m, centre of mass c and inertia I about it moves as two points of m/2 at c +- sqrt(I/m) do.
Derivatives of positions are taken by the complex step, exact to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hilrig.core.signals import Array
from hilrig.kinds.robots.planar_2r import Planar2r

STEP = 1e-30


class Point(NamedTuple):
    """A point mass on link 1 or 2, `distance` from that link's joint."""

    mass: float
    link: int
    distance: float


def points(robot: Planar2r) -> list[Point]:
    """Return the point masses that stand for the arm's links."""
    centers, inertias = robot.mass_distribution()
    found = []
    for link, (mass, center, inertia) in enumerate(zip(robot.masses, centers, inertias, strict=True), start=1):
        radius = float(np.sqrt(inertia / mass))
        found += [Point(mass / 2, link, center - radius), Point(mass / 2, link, center + radius)]
    return found


def place(robot: Planar2r, point: Point, q: np.ndarray) -> np.ndarray:
    """Return (x, z) of a point, for real or complex q."""
    elbow = (robot.dynamic_lengths or robot.lengths)[0]
    first = np.array([np.cos(q[0]), np.sin(q[0])])
    second = np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
    return point.distance * first if point.link == 1 else elbow * first + point.distance * second


def mass_matrix(robot: Planar2r, q: Array) -> Array:
    """Return M(q) from the kinetic energy of the points, (2, 2) kg m^2."""
    matrix = np.zeros((2, 2))
    for point in points(robot):
        jacobian = np.stack([place(robot, point, q + 1j * STEP * np.eye(2)[i]).imag / STEP for i in range(2)], axis=1)
        matrix += point.mass * jacobian.T @ jacobian
    return matrix


def potential(robot: Planar2r, q: np.ndarray) -> complex:
    """Return the potential energy in J, for real or complex q."""
    return -sum(point.mass * np.dot(robot.gravity, place(robot, point, q)) for point in points(robot))


def gravity_torque(robot: Planar2r, q: Array) -> Array:
    """Return G(q) = dV/dq, (2,) N m."""
    return np.array([potential(robot, q + 1j * STEP * np.eye(2)[i]).imag / STEP for i in range(2)])


def energy(robot: Planar2r, q: Array, rate: Array) -> float:
    """Return kinetic plus potential energy, J."""
    return float(0.5 * rate @ mass_matrix(robot, q) @ rate + np.real(potential(robot, q)))


def inverse_dynamics(robot: Planar2r, q: Array, rate: Array, acceleration: Array) -> Array:
    """Return d/dt dT/dq' - dT/dq + dV/dq, Lagrange's equations, (2,) N m."""
    h = 1e-5
    slopes = [(mass_matrix(robot, q + h * e) - mass_matrix(robot, q - h * e)) / (2 * h) for e in np.eye(2)]
    matrix_rate = slopes[0] * rate[0] + slopes[1] * rate[1]
    kinetic = np.array([0.5 * rate @ slope @ rate for slope in slopes])
    return mass_matrix(robot, q) @ acceleration + matrix_rate @ rate - kinetic + gravity_torque(robot, q)

"""Obstacles are drawn with their true surfaces."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.solids import pose
from app.viewer.obstacles import mesh
from dlocore import Box, Capsule, Cylinder, Sphere

ROUNDING = 1e-12  # m
TURN = np.array([0.8, 0.0, 0.36, 0.48])


def drawn(obstacle) -> np.ndarray:
    """Return the vertices of the picture in the world; (n, 3) [m]."""
    centre, wxyz = pose(obstacle)
    return centre + Rotation.from_quat(np.roll(wxyz, -1)).apply(mesh(obstacle)[0])


def test_a_sphere_is_drawn_by_points_at_its_radius():
    points = drawn(Sphere(center=(0.5, 0.2, 0.1), radius=0.04))
    np.testing.assert_allclose(np.linalg.norm(points - (0.5, 0.2, 0.1), axis=1), 0.04, rtol=0, atol=ROUNDING)


def test_a_capsule_is_drawn_by_points_at_its_radius_from_its_segment():
    start, end = np.array([0.1, 0.2, 0.3]), np.array([0.4, -0.1, 0.5])
    points = drawn(Capsule(start=start, end=end, radius=0.03))
    share = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
    nearest = start + share[:, None] * (end - start)
    np.testing.assert_allclose(np.linalg.norm(points - nearest, axis=1), 0.03, rtol=0, atol=ROUNDING)
    assert share.min() == 0.0
    assert share.max() == 1.0


@pytest.mark.parametrize("axis", [(0, 0, 1), (0, 0, -2), (1, 0, 0), (1, 2, -2)])
def test_a_cylinder_is_drawn_along_its_axis(axis):
    points = drawn(Cylinder(center=(0.5, 0.2, 0.1), axis=axis, radius=0.03, height=0.2))
    along = (points - (0.5, 0.2, 0.1)) @ axis / np.linalg.norm(axis)
    np.testing.assert_allclose(np.abs(along), 0.1, rtol=0, atol=ROUNDING)
    across = points - (0.5, 0.2, 0.1) - along[:, None] * axis / np.linalg.norm(axis)
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), 0.03, rtol=0, atol=ROUNDING)


def test_a_box_is_drawn_as_it_is_turned():
    points = drawn(Box(center=(0.5, 0.2, 0.1), size=(0.1, 0.2, 0.3), orientation=TURN))
    edges = Rotation.from_quat(np.roll(TURN, -1)).as_matrix()  # its columns are the box's axes
    corners = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.1, 0.1) for z in (-0.15, 0.15)])
    expected = np.array([0.5, 0.2, 0.1]) + corners @ edges.T
    distances = np.linalg.norm(points[:, None] - expected, axis=2)
    assert distances.min(axis=1).max() < ROUNDING  # every vertex is a corner
    assert distances.min(axis=0).max() < ROUNDING  # every corner is a vertex

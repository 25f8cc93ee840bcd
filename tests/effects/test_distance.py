"""Obstacles by their true surfaces: exact distances, unit normals, curvatures, and frames that are rotations."""

from itertools import pairwise

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore import Box, Capsule, Cylinder, SceneError, Sphere
from dlocore.effects.distance import ROW, distances, signed_distance
from dlocore.scene.obstacles import Obstacle

Floats = NDArray[np.float64]
NAN, INF = float("nan"), float("inf")
KINDS = ["sphere", "capsule", "cylinder", "box"]
EVERY = pytest.mark.parametrize("kind", KINDS)


@numba.njit(error_model="numpy")
def each(rows, points, d, n, H):
    for i in range(len(points)):
        d[i], normal, hessian = signed_distance(rows, 0, (points[i, 0], points[i, 1], points[i, 2]))
        n[i, 0], n[i, 1], n[i, 2] = normal
        for j in range(3):
            H[i, j, j] = hessian[j]
        H[i, 0, 1] = H[i, 1, 0] = hessian[3]
        H[i, 0, 2] = H[i, 2, 0] = hessian[4]
        H[i, 1, 2] = H[i, 2, 1] = hessian[5]


def at(obstacle: Obstacle, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Return distances (n,), gradients (n, 3) and Hessians (n, 3, 3) at points (n, 3)."""
    size = len(points)
    d, n, H = np.full(size, NAN), np.full((size, 3), NAN), np.full((size, 3, 3), NAN)
    each(obstacle.row()[None], points, d, n, H)
    return d, n, H


def obstacle_of(kind: str, rng: np.random.Generator) -> Obstacle:
    """Return an obstacle of 0.1 to 1 m with a random place and orientation."""
    center, axis = rng.normal(size=3), rng.normal(size=3)
    a, b, c = rng.uniform(0.1, 1.0, 3)
    if kind == "sphere":
        return Sphere(center=center, radius=a)
    if kind == "capsule":
        return Capsule(start=center, end=center + b * axis / np.linalg.norm(axis), radius=a)
    if kind == "cylinder":
        return Cylinder(center=center, axis=axis, radius=a, height=b)
    turn = rng.normal(size=4)
    return Box(center=center, size=(a, b, c), orientation=turn / np.linalg.norm(turn))


def parts(obstacle: Obstacle) -> tuple[Floats, Floats, Floats]:
    """Return the centre (3,), the frame (3, 3) and the half sizes (3,) of a row."""
    row = obstacle.row()
    return row[1:4], row[4:13].reshape(3, 3), row[13:16]


def excess(kind: str, p: Floats, half: Floats) -> Floats:
    """Return for points of the body's frame by how much (n, k) they lie out of the solid, one column a face."""
    if kind == "sphere":
        return (np.linalg.norm(p, axis=1) - half[0])[:, None]
    if kind == "capsule":
        beyond = np.maximum(np.abs(p[:, 2]) - half[2], 0.0)
        return (np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2 + beyond**2) - half[0])[:, None]
    if kind == "cylinder":
        return np.column_stack([np.hypot(p[:, 0], p[:, 1]) - half[0], np.abs(p[:, 2]) - half[2]])
    return np.abs(p) - half


def smoothness(kind: str, p: Floats, half: Floats) -> Floats:
    """Return how far (n,) points are from where the nearest point passes to another face, edge or corner."""
    gaps = [np.abs(p), excess(kind, p, half)]
    if kind == "sphere":
        gaps = [np.linalg.norm(p, axis=1, keepdims=True)]
    if kind in ("capsule", "cylinder"):
        gaps = [np.hypot(p[:, :1], p[:, 1:2]), np.abs(p[:, 2:]), np.abs(p[:, 2:]) - half[2], *gaps[1:]]
    if kind in ("cylinder", "box"):
        last = np.sort(gaps[-1], axis=1)
        gaps.append(last[:, -1:] - last[:, -2:-1])
    return np.abs(np.hstack(gaps)).min(axis=1)


def samples(kind: str, inside: bool, seed: int) -> tuple[Obstacle, Floats]:
    """Return an obstacle and at least 50 points on one side of its surface, 1 cm or more from where it isn't smooth."""
    rng = np.random.default_rng([KINDS.index(kind), inside, seed])
    obstacle = obstacle_of(kind, rng)
    center, frame, half = parts(obstacle)
    extent = half.max() + half[0] if kind == "capsule" else half.max()
    p = rng.uniform(-1.0, 1.0, (4000, 3)) * (extent if inside else 2.0 * extent)
    outside = excess(kind, p, half).max(axis=1) > 0.0
    p = p[(outside != inside) & (smoothness(kind, p, half) > 0.01)]
    assert len(p) >= 50
    return obstacle, p @ frame + center


SIDES = pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
SEEDS = pytest.mark.parametrize("seed", range(5))
STEP = 1e-5  # [m] against the 1 cm that all points keep from kinks


@EVERY
@SIDES
@SEEDS
def test_gradient_is_the_derivative_of_the_distance(kind, inside, seed):
    obstacle, points = samples(kind, inside, seed)
    _, n, _ = at(obstacle, points)
    rows = obstacle.row()[None]
    for i, e in enumerate(STEP * np.eye(3)):
        slope = (distances(rows, points + e) - distances(rows, points - e))[:, 0] / (2 * STEP)
        # step^2/6 of a third derivative of 3/(1 cm)^2 at most
        np.testing.assert_allclose(n[:, i], slope, atol=1e-6)


@EVERY
@SIDES
@SEEDS
def test_hessian_is_the_derivative_of_the_gradient(kind, inside, seed):
    obstacle, points = samples(kind, inside, seed)
    H = at(obstacle, points)[2]
    for i, e in enumerate(STEP * np.eye(3)):
        slope = (at(obstacle, points + e)[1] - at(obstacle, points - e)[1]) / (2 * STEP)
        # step^2/6 of a fourth derivative of 15/(1 cm)^3 at most
        np.testing.assert_allclose(H[:, i], slope, atol=3e-4)


@EVERY
@SIDES
@SEEDS
def test_normals_are_units_and_the_hessian_is_flat_along_them(kind, inside, seed):
    obstacle, points = samples(kind, inside, seed)
    _, n, H = at(obstacle, points)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)  # rounding
    np.testing.assert_allclose(np.einsum("nij,nj->ni", H, n), 0.0, atol=1e-12)  # rounding over 1 cm


@EVERY
@SIDES
@SEEDS
def test_distance_is_that_of_the_nearest_point_of_the_surface(kind, inside, seed):
    obstacle, points = samples(kind, inside, seed)
    center, frame, half = parts(obstacle)
    d, n, _ = at(obstacle, points)
    foot = points - d[:, None] * n
    tolerance = 1e-13  # rounding at coordinates of a few metres
    assert ((d < 0.0) == inside).all()
    np.testing.assert_allclose(excess(kind, (foot - center) @ frame.T, half).max(axis=1), 0.0, atol=tolerance)
    rng = np.random.default_rng(seed)
    around = rng.normal(size=(300, 3))
    if inside:  # no point nearer than the foot leaves the solid
        around /= np.linalg.norm(around, axis=1, keepdims=True)
        for x, depth in zip(points[:50], -d[:50], strict=True):
            ball = (x + depth * around - center) @ frame.T
            assert excess(kind, ball, half).max() <= tolerance
    else:  # the plane at the foot parts the point from the whole solid, which is convex
        extent = half.max() + half[0]
        solid = rng.uniform(-extent, extent, (20000, 3))
        solid = solid[excess(kind, solid, half).max(axis=1) <= 0.0] @ frame + center
        assert len(solid) > 50
        assert ((solid @ n[:50].T) - (foot[:50] * n[:50]).sum(axis=1)).max() <= tolerance


def value(obstacle: Obstacle, x: tuple[float, float, float]) -> float:
    return float(distances(obstacle.row()[None], np.array([x]))[0, 0])


@pytest.mark.parametrize(
    ("obstacle", "x", "expected"),
    [
        (Sphere(center=(1.0, 0.0, 0.0), radius=0.5), (4.0, 4.0, 0.0), 4.5),
        (Sphere(center=(1.0, 0.0, 0.0), radius=0.5), (1.0, 0.2, 0.0), -0.3),
        (Sphere(center=(1.0, 0.0, 0.0), radius=0.5), (1.0, 0.0, 0.0), -0.5),
        (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 2.0, 0.0), radius=0.25), (1.0, 1.7, 0.0), 0.75),
        (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 2.0, 0.0), radius=0.25), (3.0, 6.0, 0.0), 4.75),
        (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 2.0, 0.0), radius=0.25), (0.0, -1.0, 0.0), 0.75),
        (Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 2.0, 0.0), radius=0.25), (0.0, 0.5, 0.1), -0.15),
        (Cylinder(center=(0.0, 0.0, 1.0), radius=1.0, height=2.0), (0.0, 3.0, 1.5), 2.0),
        (Cylinder(center=(0.0, 0.0, 1.0), radius=1.0, height=2.0), (0.3, 0.2, 5.0), 3.0),
        (Cylinder(center=(0.0, 0.0, 1.0), radius=1.0, height=2.0), (0.0, 4.0, -4.0), 5.0),
        (Cylinder(center=(0.0, 0.0, 1.0), radius=1.0, height=2.0), (0.6, 0.0, 1.0), -0.4),
        (Cylinder(center=(0.0, 0.0, 1.0), radius=1.0, height=2.0), (0.0, 0.5, 0.1), -0.1),
        (Cylinder(center=(0.0, 0.0, 0.0), axis=(5.0, 0.0, 0.0), radius=1.0, height=4.0), (6.0, 0.0, 4.0), 5.0),
        (Box(center=(0.0, 0.0, 0.0), size=(2.0, 4.0, 6.0)), (3.0, 1.0, -2.0), 2.0),
        (Box(center=(0.0, 0.0, 0.0), size=(2.0, 4.0, 6.0)), (4.0, -6.0, 1.0), 5.0),
        (Box(center=(0.0, 0.0, 0.0), size=(2.0, 4.0, 6.0)), (2.0, 4.0, -5.0), 3.0),
        (Box(center=(0.0, 0.0, 0.0), size=(2.0, 4.0, 6.0)), (0.5, 1.8, 0.0), -0.2),
        # a quarter turn about z: the edge of 4 m lies along -x
        (
            Box(center=(0.0, 0.0, 0.0), size=(2.0, 4.0, 6.0), orientation=(0.5**0.5, 0.0, 0.0, 0.5**0.5)),
            (3.0, 0.0, 0.0),
            1.0,
        ),
        # an eighth turn about z: a positive one moves the corner (1, -1) onto +x
        (
            Box(center=(0.0, 0.0, 0.0), size=(2.0, 2.0, 2.0), orientation=(np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8))),
            (2.0, 0.0, 0.0),
            2.0 - 2.0**0.5,
        ),
    ],
)
def test_distance_of_closed_forms(obstacle, x, expected):
    assert value(obstacle, x) == pytest.approx(expected, abs=1e-14)  # rounding


def test_a_box_turns_by_its_quaternion_and_not_by_the_inverse():
    # sizes 2 x 0.2: turned by +30 degrees about z, the long edge points to (cos 30, sin 30)
    angle = np.pi / 6
    turn = (np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2))
    box = Box(center=(0.0, 0.0, 0.0), size=(2.0, 0.2, 0.2), orientation=turn)
    assert value(box, (0.9 * np.cos(angle), 0.9 * np.sin(angle), 0.0)) == pytest.approx(-0.1, abs=1e-14)  # rounding
    assert value(box, (0.9 * np.cos(angle), -0.9 * np.sin(angle), 0.0)) > 0.5


def eigenvalues(obstacle: Obstacle, x: tuple[float, float, float]) -> Floats:
    return np.linalg.eigvalsh(at(obstacle, np.array([x]))[2][0])


def test_curvatures_of_the_surfaces_of_equal_distance():
    rounding = {"abs": 1e-13}
    ball = Sphere(center=(0.0, 0.0, 0.0), radius=0.5)
    cylinder = Cylinder(center=(0.0, 0.0, 0.0), axis=(1.0, 1.0, 0.0), radius=1.0, height=2.0)
    box = Box(center=(0.0, 0.0, 0.0), size=(2.0, 2.0, 2.0))
    along = np.array([1.0, 1.0, 0.0]) / 2**0.5
    assert eigenvalues(ball, (0.0, 2.0, 0.0)) == pytest.approx([0.0, 0.5, 0.5], **rounding)
    assert eigenvalues(cylinder, (0.0, 0.0, 4.0)) == pytest.approx([0.0, 0.0, 0.25], **rounding)
    assert eigenvalues(cylinder, (0.0, 0.0, 0.5)) == pytest.approx([0.0, 0.0, 2.0], **rounding)
    assert eigenvalues(cylinder, tuple(3.0 * along)) == pytest.approx([0.0, 0.0, 0.0], **rounding)
    # at the edge, (3, 4) m from it: 1/5 across, and along the circle 3/5 over 4 m from the axis
    assert eigenvalues(cylinder, tuple(5.0 * along + [0.0, 0.0, 4.0])) == pytest.approx([0.0, 0.15, 0.2], **rounding)
    assert eigenvalues(box, (3.0, 0.5, 0.5)) == pytest.approx([0.0, 0.0, 0.0], **rounding)
    assert eigenvalues(box, (4.0, 5.0, 0.5)) == pytest.approx([0.0, 0.0, 0.2], **rounding)
    assert eigenvalues(box, (2.0, 3.0, 3.0)) == pytest.approx([0.0, 1 / 3, 1 / 3], **rounding)


@EVERY
@SEEDS
def test_degenerate_points_have_some_unit_normal_and_never_nan(kind, seed):
    rng = np.random.default_rng(seed)
    obstacle = obstacle_of(kind, rng)
    center, frame, half = parts(obstacle)
    grid = np.array([(x, y, z) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) for z in (-1.0, 0.0, 1.0)])
    extent = np.where(half > 0.0, half, half[0])  # the second half size of round bodies is zero
    # faces, edges, corners and axes, there and beyond; off them by less than rounding, and by numbers without squares
    p = np.vstack([s * grid * extent + e for s in (1.0, 3.0) for e in (0.0, 1e-17, -1e-14, 1e-11, 1e-200, 1e-320)])
    d, n, H = at(obstacle, p @ frame + center)
    assert np.isfinite(d).all()
    assert np.isfinite(H).all()
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)  # rounding


def test_normals_at_centres_and_axes_point_to_a_nearest_point():
    # bodies at the origin, so that the points are degenerate to the last bit
    bodies = [
        Sphere(center=(0.0, 0.0, 0.0), radius=0.3),
        Capsule(start=(0.0, 0.0, -0.5), end=(0.0, 0.0, 0.5), radius=0.3),
        Cylinder(center=(0.0, 0.0, 0.0), radius=0.3, height=1.0),
        Cylinder(center=(0.0, 0.0, 0.0), radius=1.0, height=0.6),
        Box(center=(0.0, 0.0, 0.0), size=(0.6, 0.6, 0.6)),
    ]
    for tiny in (0.0, 1e-320, 1e-200, 1e-17):
        for body in bodies:
            d, n, H = at(body, np.full((1, 3), tiny))
            assert d[0] == pytest.approx(-0.3, abs=1e-15)  # rounding
            assert np.linalg.norm(n[0]) == 1.0
            assert value(body, tuple(0.3 * n[0])) == pytest.approx(0.0, abs=1e-15)  # rounding
            assert not H.any()


@EVERY
def test_distance_is_continuous_where_faces_meet(kind):
    obstacle = obstacle_of(kind, np.random.default_rng(5))
    center, frame, half = parts(obstacle)
    rng = np.random.default_rng(6)
    corner = np.where(half > 0.0, half, 0.0) * rng.choice([-1.0, 1.0], (500, 3))
    near = corner + rng.normal(size=(500, 3)) * 10.0 ** rng.uniform(-14, -2, (500, 1))
    points = near @ frame + center
    d = at(obstacle, points)[0]
    for a, b in pairwise(range(500)):
        # a distance changes at most by the way, plus the threshold of 1e-12 m below which an edge is a face
        assert abs(d[a] - d[b]) <= np.linalg.norm(points[a] - points[b]) + 3e-12


def test_distances_have_a_row_a_point_and_a_column_an_obstacle():
    rng = np.random.default_rng(8)
    obstacles = [obstacle_of(kind, rng) for kind in KINDS]
    points = rng.normal(size=(7, 3))
    table = distances(np.array([o.row() for o in obstacles]), points)
    for k, obstacle in enumerate(obstacles):
        np.testing.assert_array_equal(table[:, k], at(obstacle, points)[0])
    assert distances(np.empty((0, ROW)), points).shape == (7, 0)


@EVERY
@SEEDS
def test_frames_are_rotations_and_rows_hold_the_friction(kind, seed):
    obstacle = obstacle_of(kind, np.random.default_rng(seed))
    _, frame, _ = parts(obstacle)
    assert obstacle.row().shape == (ROW,)
    assert obstacle.row()[-1] == 0.0
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)  # rounding
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-14)  # rounding


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), (1e-9, 0.0, -1.0), (1.0, 1.0, 1.0), (0.0, 1e4, 0.0)])
def test_frames_of_special_axes_are_rotations(axis):
    _, frame, _ = parts(Cylinder(center=(0.0, 0.0, 0.0), radius=1.0, height=1.0, axis=axis, friction=0.3))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)  # rounding
    np.testing.assert_allclose(frame[2], np.array(axis) / np.linalg.norm(axis), atol=1e-15)  # rounding
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-14)  # rounding


def test_a_body_that_stands_on_the_table_is_upright_there():
    # a cable of radius 1.5 mm, its centreline at 0.3, from which on walls push it sideways
    height, radius = 0.3, 0.0015
    middle = height + 0.05
    quarter = Rotation.from_euler("y", 90, degrees=True).as_quat()[[3, 0, 1, 2]]
    for body in (
        Cylinder(center=(0.0, 0.0, middle), radius=0.02, height=0.1),
        Cylinder(center=(0.0, 0.0, middle), axis=(0.0, 0.0, -2.0), radius=0.02, height=0.1),
        Box(center=(0.0, 0.0, middle), size=(1.0, 2.0, 0.1)),
        Box(center=(0.0, 0.0, middle), size=(0.1, 2.0, 1.0), orientation=quarter),
    ):
        assert body.upright_at(height, radius)
        assert body.upright_at(middle, radius)
        assert not body.upright_at(height - 1e-5, radius)
        assert body.upright_at(middle + 0.05 - radius, radius)
        assert not body.upright_at(middle + 0.05 - radius, radius + 1e-5)
        assert not body.upright_at(middle + 0.05, radius)


def test_a_capsule_is_upright_between_its_round_ends():
    for ends in ((0.0, 0.1), (0.1, 0.0)):
        start, end = [(0.2, 0.3, z) for z in ends]
        body = Capsule(start=start, end=end, radius=0.02)
        assert body.upright_at(0.05, 0.01)
        assert body.upright_at(0.0, 0.01)
        assert not body.upright_at(-0.005, 0.01)
        assert not body.upright_at(0.11, 0.01)


def test_level_bodies_are_upright_only_at_the_height_of_their_axis():
    height = 0.1 + 0.2  # which is not 0.3 to the last bit
    for body in (
        Sphere(center=(1.0, 0.0, 0.3), radius=0.1),
        Capsule(start=(0.0, 0.0, 0.3), end=(1.0, 1.0, 0.3), radius=0.1),
        Cylinder(center=(0.0, 0.0, 0.3), axis=(1.0, -2.0, 0.0), radius=0.1, height=1.0),
    ):
        assert body.upright_at(height, 0.01)
        assert not body.upright_at(height + 1e-6, 0.01)


def test_tilted_bodies_are_not_upright():
    tilt = np.array([1e-6, 0.0, 1.0])
    turn = Rotation.from_euler("xyz", [1e-6, 1e-6, 0.4]).as_quat()[[3, 0, 1, 2]]
    for body in (
        Capsule(start=-tilt, end=tilt, radius=0.1),
        Capsule(start=(-1.0, 0.0, -1e-6), end=(1.0, 0.0, 1e-6), radius=0.1),
        Capsule(start=(-1.0, 0.0, 0.0), end=(1.0, 0.0, 1e-6), radius=0.1),
        Capsule(start=(-1.0, 0.0, 1e-6), end=(1.0, 0.0, 0.0), radius=0.1),
        Cylinder(center=(0.0, 0.0, 0.0), axis=tilt, radius=0.1, height=1.0),
        Cylinder(center=(0.0, 0.0, 0.0), axis=(1.0, 0.0, 1e-6), radius=0.1, height=1.0),
        Box(center=(0.0, 0.0, 0.0), size=(1.0, 1.0, 1.0), orientation=turn),
    ):
        assert not body.upright_at(0.0, 0.01)


@EVERY
def test_normals_of_upright_bodies_are_horizontal_at_the_table(kind):
    height, reach = 0.3, 0.02
    rng = np.random.default_rng(9)
    spin = Rotation.from_euler("z", 0.7).as_quat()[[3, 0, 1, 2]]
    body = {
        "sphere": Sphere(center=(0.1, 0.2, height), radius=0.3),
        "capsule": Capsule(start=(0.1, 0.2, height - reach), end=(0.1, 0.2, 1.0), radius=0.3),
        "cylinder": Cylinder(center=(0.1, 0.2, height + 0.2), radius=0.3, height=0.4 + 2 * reach),
        "box": Box(center=(0.1, 0.2, height), size=(0.5, 0.6, 2 * reach), orientation=spin),
    }[kind]
    assert body.upright_at(height, reach)
    points = np.column_stack([rng.uniform(-0.6, 0.6, (2000, 2)), np.full(2000, height)])
    d, n, _ = at(body, points)
    touched = d > -0.99 * reach
    assert np.abs(n[touched, 2]).max() < 1e-14  # rounding


ORIGIN = (0.0, 0.0, 0.0)
BAD = [
    (Sphere, {"center": ORIGIN, "radius": 0.1}),
    (Capsule, {"start": ORIGIN, "end": (1.0, 0.0, 0.0), "radius": 0.1}),
    (Cylinder, {"center": ORIGIN, "radius": 0.1, "height": 0.1, "axis": (0.0, 0.0, 1.0)}),
    (Box, {"center": ORIGIN, "size": (1.0, 1.0, 1.0), "orientation": (1.0, 0.0, 0.0, 0.0)}),
]
POINT = [(NAN, 0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0, 0.0), "abc", (INF, 0.0, 0.0), (1e300, 0.0, 0.0)]
LENGTH = [0.0, -1.0, NAN, INF, 1e5, "1", True, None]
WRONG = {
    "center": POINT,
    "start": POINT,
    "end": [*POINT, ORIGIN],
    "axis": [*POINT, ORIGIN],
    "radius": LENGTH,
    "height": LENGTH,
    "size": [(1.0, 1.0, 0.0), (1.0, -1.0, 1.0), (1.0, 1e5, 1.0), (NAN, 1.0, 1.0), (1.0, 1.0)],
    "orientation": [(0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (NAN, 0.0, 0.0, 0.0)],
    "friction": [-0.1, NAN, INF, 11.0, "rough"],
}


@pytest.mark.parametrize(("obstacle", "good"), BAD, ids=KINDS)
def test_bad_obstacles_name_the_field(obstacle, good):
    obstacle(**good)
    for field in [*good, "friction"]:
        for bad in WRONG[field]:
            with pytest.raises(SceneError) as caught:
                obstacle(**(good | {field: bad}))
            assert caught.value.field.partition("[")[0] == field, (field, bad)

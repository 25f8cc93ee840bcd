"""Meshes and instance poses for the picture: pure functions of arrays."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Faces = NDArray[np.uint32]
Mesh = tuple[Floats, Faces]


def segment_poses(points: Floats) -> tuple[Floats, Floats]:
    """Place a body that lies along z on every segment of a polyline.

    Args:
        points: (n + 1, 3) [m].

    Returns:
        Centres (n, 3) [m] and quaternions wxyz (n, 4).
    """
    steps = np.diff(points, axis=0)
    direction = steps / np.maximum(np.linalg.norm(steps, axis=1), 1e-12)[:, None]
    # the shortest rotation from z to the direction; for straight down, half a turn about x
    wxyz = np.column_stack([1.0 + direction[:, 2], -direction[:, 1], direction[:, 0], np.zeros(len(steps))])
    wxyz[direction[:, 2] < -1.0 + 1e-9] = (0.0, 1.0, 0.0, 0.0)
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    return 0.5 * (points[1:] + points[:-1]), wxyz


def upright(direction: Floats, approach: Floats | None = None) -> Floats:
    """Return axes (3, 3), in columns, with x along `direction` (3,) and z as near to `approach` as possible.

    Args:
        direction: direction of the cable where it is held.
        approach: direction of the gripper's stem; if absent, upwards. If the cable runs along it, y takes its place.
    """
    x = direction / max(float(np.linalg.norm(direction)), 1e-12)
    z = np.array([0.0, 0.0, 1.0]) if approach is None else approach
    across = z - (z @ x) * x
    if float(np.linalg.norm(across)) < 1e-3:
        side = np.array([0.0, 1.0, 0.0])
        across = side - (side @ x) * x
    z = across / np.linalg.norm(across)
    return np.column_stack([x, np.cross(z, x), z])


def quaternion(axes: Floats) -> Floats:
    """Return the quaternion wxyz (4,) of axes (3, 3) in columns."""
    return np.roll(Rotation.from_matrix(axes).as_quat(), 1)


def cylinder(radius: float, sides: int = 14) -> Mesh:
    """Return a closed cylinder of unit height along z, centred, with sharp edges at its ends."""
    angles = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    ring = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    low, high = (np.column_stack([ring, np.full(sides, z)]) for z in (-0.5, 0.5))
    k = np.arange(sides)
    n = np.roll(k, -1)
    wall = np.concatenate([np.column_stack([k, n, k + sides]), np.column_stack([n, n + sides, k + sides])])
    fan = k[1:-1]
    bottom = np.column_stack([np.full(sides - 2, 2 * sides), 2 * sides + fan + 1, 2 * sides + fan])
    top = np.column_stack([np.full(sides - 2, 3 * sides), 3 * sides + fan, 3 * sides + fan + 1])
    return np.concatenate([low, high, low, high]), np.concatenate([wall, bottom, top]).astype(np.uint32)


def capsule(radius: float, length: float, sides: int = 14, rings: int = 4) -> Mesh:
    """Return a cylinder of `length` [m] along z, centred, with hemispheres at its ends: a link of a smooth chain."""
    angles = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    latitudes = np.linspace(0.0, 0.5 * np.pi, rings, endpoint=False)
    upper = [(radius * np.cos(x), 0.5 * length + radius * np.sin(x)) for x in latitudes]
    profile = [(r, -z) for r, z in reversed(upper)] + upper
    circles = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(sides, z)]) for r, z in profile]
    poles = np.array([[0.0, 0.0, -0.5 * length - radius], [0.0, 0.0, 0.5 * length + radius]])
    k, n = np.arange(sides), np.roll(np.arange(sides), -1)
    faces = []
    for i in range(len(profile) - 1):
        low, high = i * sides, (i + 1) * sides
        faces += [np.column_stack([low + k, low + n, high + k]), np.column_stack([low + n, high + n, high + k])]
    last, south = (len(profile) - 1) * sides, len(profile) * sides
    faces += [np.column_stack([np.full(sides, south), n, k])]
    faces += [np.column_stack([np.full(sides, south + 1), last + k, last + n])]
    return np.concatenate([*circles, poles]), np.concatenate(faces).astype(np.uint32)


def box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> Mesh:
    """Return a box with edges of `size` [m] around `centre` [m]; every face has its own vertices, for sharp edges."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    vertices = np.concatenate([corners[list(quad)] for quad in quads]) * size + centre
    faces = np.concatenate([[[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]] for i in range(6)])
    return vertices, faces.astype(np.uint32)


def joined(*meshes: Mesh) -> Mesh:
    """Return several meshes as one."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in meshes[:-1])])
    faces = [faces + offset for (_, faces), offset in zip(meshes, offsets, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces).astype(np.uint32)


def gripper(cable_diameter: float, scale: float = 1.0) -> Mesh:
    """Return a parallel gripper at the origin, with its fingers on both sides (y) of a cable along x.

    The fingers are 52 mm long, times `scale`.
    """
    half = 0.5 * cable_diameter / scale
    finger, reach, width = 0.006, 0.052, 0.020
    fingers = [
        box((width, finger, reach), (0.0, side * (half + 0.5 * finger), 0.5 * reach - half)) for side in (-1.0, 1.0)
    ]
    palm = box((1.3 * width, 2 * half + 5 * finger, 0.018), (0.0, 0.0, reach + 0.009 - half))
    vertices, faces = cylinder(0.009)
    stem = (vertices * (1.0, 1.0, 0.05) + (0.0, 0.0, reach + 0.043 - half), faces)
    vertices, faces = joined(*fingers, palm, stem)
    return scale * vertices, faces


def strip_faces(rows: int, columns: int) -> Faces:
    """Return the triangles of a grid of `rows` x `columns` vertices in row-major order; (2 (rows-1)(columns-1), 3)."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.uint32)


def segments(points: Floats) -> Floats:
    """Return the segments (n, 2, 3) of a polyline (n + 1, 3) [m]."""
    return np.stack([points[:-1], points[1:]], axis=1)

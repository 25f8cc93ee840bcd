"""Frames of clamps of which only the direction is known, and the sections of a cable between two of them."""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore.answer.frames import unit
from dlocore.identify.span import Span
from dlocore.scene.scene import ControlPoints, Material
from dlocore.shape.transport import transported
from dlocore.spline import design_matrix, greville

Floats = NDArray[np.float64]


def across(direction: Floats) -> Floats:
    """Return a unit vector (3,) perpendicular to a unit direction (3,)."""
    axis = np.zeros(3)
    axis[int(np.argmin(np.abs(direction)))] = 1.0
    out = axis - direction * (axis @ direction)
    return np.asarray(out / np.linalg.norm(out))


def tilted(direction: Floats, angles: Floats) -> Floats:
    """Return a unit direction (3,) tilted by two angles [rad]."""
    first = across(direction)
    second = np.cross(direction, first)
    out = direction + np.tan(angles[0]) * first + np.tan(angles[1]) * second
    return np.asarray(out / np.linalg.norm(out))


def turned_from(reference: Floats, directions: Floats) -> Rotation:
    """Return the smallest rotations that turn `reference` to the unit `directions` (k, 3)."""
    axis = np.cross(reference, directions)
    cosine = np.clip(directions @ reference, -0.999, 1.0)
    half = np.sqrt(0.5 * (1.0 + cosine))
    quaternion = np.column_stack([axis / (2.0 * half)[:, None], half])
    return Rotation.from_quat(quaternion)


def carried(tangents: Floats, director: Floats) -> Floats:
    """Return a director (..., 3), given at the first of unit tangents (n, ..., 3), carried along them without twist.

    It is first made perpendicular to the first tangent. The result has the shape of the tangents.
    """
    out = np.empty_like(tangents)
    first = director - tangents[0] * (tangents[0] * director).sum(axis=-1, keepdims=True)
    out[0] = unit(first)
    for i in range(1, len(tangents)):
        out[i] = transported(tangents[i - 1], tangents[i], out[i - 1])
    return out


def rest_points(rest_curvature: Floats, span: Span, direction: Floats) -> Floats:
    """Return points (k, 3) [m] along the stress-free shape of a whole cable, from the origin.

    Args:
        rest_curvature: (k, 2) [1/m] in the frame of the sections, from end to end of the span; straight beyond.
        span: the part of the cable that bends.
        direction: (3,) in which the points begin, with the director of a clamp that has this reference direction.
    """
    u = np.unique(np.concatenate([np.linspace(0.0, span.whole, 201), [span.begin, span.begin + span.length]]))
    middle = 0.5 * (u[1:] + u[:-1]) - span.begin
    places = np.linspace(0.0, span.length, len(rest_curvature))
    on = (middle > 0.0) & (middle < span.length)
    bends = np.column_stack([np.interp(middle, places, column) * on for column in rest_curvature.T])
    tangent, director, points = direction, across(direction), [np.zeros(3)]
    for step, (first, second) in zip(np.diff(u), bends, strict=True):
        axis = first * np.cross(tangent, director) - second * director  # about which the tangent turns
        half = Rotation.from_rotvec(0.5 * step * axis)
        points.append(points[-1] + step * half.apply(tangent))
        tangent, director = (half * half).apply([tangent, director])
    return np.array(points)


def with_sections(
    shape: ControlPoints, rest_curvature: Floats | None, turn: float, frames: list[tuple[Floats, Floats]]
) -> ControlPoints:
    """Return the start with the sections turned as the clamps hold them, and with the stress-free bends.

    Args:
        shape: the centreline.
        rest_curvature: (k, 2) [1/m] in the frame of the sections, from end to end; None: straight.
        turn: [rad] of the last clamp relative to the first.
        frames: director and tangent of each clamp.
    """
    knots, q = cast(Floats, shape.knots), cast(Floats, shape.control_points)[:, :3]
    length = float(knots[-1])
    director = frames[0][0] - frames[0][1] * (frames[0][0] @ frames[0][1])
    director /= np.linalg.norm(director)
    theta = 0.0
    if len(frames) == 2:
        u = np.linspace(0.0, length, 201)
        t = unit(design_matrix(knots, u, 1) @ q)
        d, end = carried(t, director)[-1], frames[1][0]
        theta = float(np.arctan2(np.cross(d, end) @ t[-1], d @ end)) + turn
        theta = (theta + np.pi) % (2.0 * np.pi) - np.pi
    middle = greville(knots)
    bends = np.zeros((2, 2)) if rest_curvature is None else rest_curvature
    at = np.linspace(0.0, length, 201)
    places = np.linspace(0.0, length, len(bends))
    memory = np.column_stack([np.interp(at, places, bends[:, 0]), np.interp(at, places, bends[:, 1]), 0.0 * at])
    return replace(
        shape,
        control_points=np.column_stack([q, theta * middle / length]),
        material=Material(director=director, u=at, memory=memory, natural=memory),
    )

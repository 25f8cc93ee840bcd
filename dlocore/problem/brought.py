"""A start that is moved to where the grippers that hold it begin."""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.scene.paths import Waypoints
from dlocore.scene.scene import Scene
from dlocore.shape.shape import SplineCurve, StartCurve, fit_to_knots
from dlocore.spline import greville

Floats = NDArray[np.float64]

GRASP_TOLERANCE = 0.010  # [m]: largest distance of the first waypoint from the cable
_SPANS = 32  # least number of a start of which a part is moved
_ROUNDING = 1e-12  # of the length
_TIMES = 20  # most iterations of the move


def brought(scene: Scene, start: StartCurve) -> StartCurve:
    """Return a start that passes through the first waypoints of the grasps that hold it from the beginning.

    If one grasp holds it, it is moved as a whole. Between two grasps it is moved by
    d(u) = d_1 + (d_2 - d_1) s^2 (3 - 2 s) with s = (u - u_1)/(u_2 - u_1), which turns it at neither of them. At a
    grasp without waypoints d is 0. Moving only the nearest control points by a few millimetres would bend the cable
    with thousands of newtons.

    Raises:
        SceneError: a first waypoint is farther than GRASP_TOLERANCE from the cable.
    """
    if not any(isinstance(g.path, Waypoints) and g.start == 0.0 for g in scene.grasps):
        return start
    held = sorted((g for g in scene.grasps if g.start == 0.0), key=lambda g: g.u)
    u = np.array([g.u for g in held])
    begins = start(u)
    targets = np.array([g.path.at(np.zeros(1), begin)[0] for g, begin in zip(held, begins, strict=True)])
    off = np.linalg.norm(targets - begins, axis=1)
    for g, target, away in zip(held, targets, off, strict=True):
        if not away <= GRASP_TOLERANCE:
            reason = f"The cable is {away:.3g} m from it at u = {g.u:g} m"
            allowed = f"a point within {GRASP_TOLERANCE:g} m of the grasped point"
            raise SceneError(f"primitives[{scene.grasps.index(g)}].path.positions[0]", target, allowed, reason)
    if not off.max() > _ROUNDING * scene.cable.length:
        return start
    knots = start.knots if start.material is not None or len(u) < 2 else finer(start.knots)
    control = fit_to_knots(start, knots)
    for _ in range(_TIMES):
        missed = targets - SplineCurve(knots=knots, control_points=control)(u)
        if not np.abs(missed).max() > _ROUNDING * scene.cable.length:
            break
        control = control + _between(greville(knots), u, missed)
    return replace(start, knots=knots, control_points=control)


def _between(places: Floats, u: Floats, ways: Floats) -> Floats:
    """Return the displacements (n, 3) at `places` (n,), interpolated from `ways` (k, 3) at u (k,), rising."""
    at = np.interp(places, u, np.arange(len(u)))
    left = np.minimum(at.astype(int), max(len(u) - 2, 0))
    right = np.minimum(left + 1, len(u) - 1)
    s = (at - left)[:, None]
    return cast(Floats, ways[left] + (ways[right] - ways[left]) * s**2 * (3.0 - 2.0 * s))


def finer(knots: Floats) -> Floats:
    """Return the knots with more of them added, (n,) [m], so that a part of the cable can be moved."""
    length = knots[-1]
    even = np.linspace(0.0, length, _SPANS + 1)[1:-1]
    apart = np.abs(even[:, None] - knots[None]).min(axis=1)
    return np.sort(np.concatenate([knots, even[apart > 0.25 * length / _SPANS]]))

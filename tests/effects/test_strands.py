"""Strands of a cable that are wound, knotted and pinched do not go through each other."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Points,
    Scene,
    SplineSurface,
    Table,
    Waypoints,
    predict,
)
from tests.solver.scenes import WEIGHTLESS, converged

D = 0.005  # [m] of the pinched cable


def closest_strands(surface: SplineSurface, apart_by: float) -> float:
    """Return the least distance [m] of two points of the centreline at least `apart_by` [m] of cable apart."""
    u, t = np.linspace(0, surface.length, 301), np.linspace(0, surface.horizon, 161)
    strange = np.abs(u[:, None] - u) >= apart_by
    least = np.inf
    for r in surface.positions(u, t):
        squares = (r * r).sum(axis=1)
        distance = np.sqrt(np.maximum(squares[:, None] + squares - 2 * r @ r.T, 0.0))
        least = min(least, float(distance[strange].min()))
    return least


def twisted_pair(**changes: Any) -> Scene:
    """Return a U whose two strands are wound around each other by three quarters of a turn of their upper ends.

    Straight strands d = 40 mm apart come as near as d cos(angle/2): without contact they would cross at half a turn.
    """
    d, angle = 0.04, 1.5 * np.pi
    leg = 0.3
    s = np.linspace(0.0, np.pi * d / 2 + 2 * leg, 201)
    turn = np.clip((s - leg) / (d / 2), 0.0, np.pi)
    z = leg - np.minimum(s, leg) - d / 2 * np.sin(turn) + np.maximum(s - leg - np.pi * d / 2, 0.0)
    points = np.column_stack([-d / 2 * np.cos(turn), 0 * s, z])
    length = float(s[-1])
    steps = np.linspace(0.0, 1.0, 25)
    phi = angle * steps**3 * (10 - 15 * steps + 6 * steps**2)
    circle = 0.5 * d * np.column_stack([np.cos(phi), np.sin(phi), 0 * phi])
    lift = [0.0, 0.0, leg] - 0.004 * steps[:, None] * [0.0, 0.0, 1.0]
    grasps = (
        Grasp(u=0.0, path=Waypoints(times=1.5 * steps, positions=lift - circle)),
        Grasp(u=length, path=Waypoints(times=1.5 * steps, positions=lift + circle)),
        Grasp(u=leg),
        Grasp(u=length - leg),
    )
    made = Cable(
        length=length, diameter=0.006, linear_density=0.03, bending_stiffness=2e-4, axial_stiffness=200.0,
        bending_damping=5e-5,
    )  # fmt: skip
    values: dict[str, Any] = {
        "cable": made,
        "shape": Points(points=points),
        "grasps": grasps,
        "environment": Environment(drag=0.1),
        "effects": {"self_contact": "on"},
    }
    return Scene(**(values | changes))


@pytest.mark.slow
def test_strands_that_are_wound_around_each_other_do_not_pass_through():
    wound = converged(twisted_pair())
    assert closest_strands(wound.surface, 0.05) > 0.95 * 0.006
    # without contact they do
    assert closest_strands(predict(twisted_pair(effects={"self_contact": "off"})).surface, 0.05) < 0.5 * 0.006


def knotted(**changes: Any) -> Scene:
    """Return an overhand knot, Shastri's curve of degrees 3, 4 and 5, whose ends two grippers pull 0.12 m apart."""
    p = np.linspace(-2.1, 2.1, 2001)
    curve = np.column_stack([p**3 - 3 * p, p**4 - 4 * p**2, 0.3 * (p**5 - 10 * p)])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.linspace(0.0, s[-1], 401)
    points = np.column_stack([np.interp(at, s, column) for column in curve.T]) / s[-1]
    length = 1.0
    chord = points[-1] - points[0]
    away = 0.06 * chord / np.linalg.norm(chord)
    made = Cable(
        length=length, diameter=0.004, linear_density=0.03, bending_stiffness=5e-4, axial_stiffness=200.0,
        bending_damping=1e-4,
    )  # fmt: skip
    values: dict[str, Any] = {
        "cable": made,
        "shape": Points(points=points),
        "grasps": (
            Grasp(u=0.0, path=Move(displacement=-away, duration=1.5)),
            Grasp(u=length, path=Move(displacement=away, duration=1.5)),
        ),
        "environment": replace(WEIGHTLESS, drag=0.2),
        "effects": {"self_contact": "on"},
    }
    return Scene(**(values | changes))


@pytest.mark.slow
def test_a_tightened_knot_stays_a_knot():
    tightened = converged(knotted())
    assert closest_strands(tightened.surface, 0.05) > 0.95 * 0.004


def hairpin(**changes: Any) -> Scene:
    """Return a U on a table whose legs two grippers pinch together: its tails would cross."""
    radius, leg = 0.05, 0.35
    s = np.linspace(0.0, np.pi * radius + 2 * leg, 161)
    turn = np.clip((s - leg) / radius, 0.0, np.pi)
    x = np.minimum(s - leg, 0.0) + radius * np.sin(turn) - np.maximum(s - leg - np.pi * radius, 0.0)
    length = float(s[-1])
    inward = radius - 1.5 * D
    values: dict[str, Any] = {
        "cable": Cable(length=length, diameter=D, linear_density=0.05, bending_stiffness=1e-3, bending_damping=2e-4),
        "shape": Points(points=np.column_stack([x, -radius * np.cos(turn)])),
        "grasps": (
            Grasp(u=0.25, path=Move(displacement=(0.0, inward, 0.0), duration=1.5)),
            Grasp(u=length - 0.25, path=Move(displacement=(0.0, -inward, 0.0), duration=1.5)),
        ),
        "environment": Environment(drag=0.2, table=Table()),
        "effects": {"self_contact": "on"},
        "horizon": 2.0,
    }
    return Scene(**(values | changes))


@pytest.mark.slow
def test_the_tails_of_a_pinched_loop_on_a_table_do_not_cross():
    pinched = converged(hairpin())
    assert pinched.accuracy.dimensions == 2
    assert closest_strands(pinched.surface, 0.05) > 0.95 * D
    assert closest_strands(predict(hairpin(effects={"self_contact": "off"})).surface, 0.05) < 0.5 * D

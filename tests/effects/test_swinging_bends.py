"""Bends that are free of stress and swing about the cable beside them (docs/model.md eq. 19b)."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.choices import from_rigid, swinging
from benchmarks.hard.curves import bend
from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, predict
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.spline import design_matrix
from tests.solver.scenes import Floats, march, samples


@pytest.mark.parametrize(
    ("angle", "width", "n_u", "allowed"),
    [
        (30, 0.005, 13, 5e-4),
        (50, 0.005, 21, 1e-4),
        (90, 0.01, 21, 1e-4),
        (90, 0.03, 13, 5e-4),
        (90, 0.06, 13, 1e-4),
        (90, 0.1, 21, 1e-3),
        (170, 0.06, 21, 1e-4),
    ],
)
def test_a_bent_wire_that_is_turned_slowly_swings_as_a_rigid_body(angle, width, n_u, allowed):
    # theta alone, without what it misses between the knots, is 6 to 2000 times farther off
    found = predict(swinging(angle, width, march(n_u, 25)), keep_grid=True)
    assert found.status == "converged"
    assert from_rigid(found) < allowed


@pytest.mark.parametrize(("angle", "width"), [(50, 0.005), (90, 0.01), (90, 0.06), (170, 0.02)])
def test_the_error_of_a_swinging_bend_is_told(angle, width):
    for quality in (Quality(), Quality(n_u=13, n_t=25, method="march", keep_grid=True)):
        found = predict(swinging(angle, width, quality))
        assert found.status == "converged"
        assert found.accuracy.error_estimate is not None
        assert from_rigid(found) < 2.0 * found.accuracy.error_estimate


@pytest.mark.parametrize("beside", [0.0, 0.003, 0.012])
def test_a_corner_has_several_spans_also_beside_a_grasp(beside: float):
    at = 0.45  # m
    corner = swinging(125, 0.005, Quality())
    lifted = Grasp(u=at - beside, path=Move(displacement=(0.0, 0.1, 0.1), duration=1.0))
    problem = pose(replace(corner, grasps=(lifted,)))
    assert problem.twist is not None
    grid = make_grid(problem, 41)
    assert np.diff(np.unique(grid.knots)).min() > 2e-4
    assert _largest_turn(grid.knots, grid.start) < np.radians(125) / 3


def _largest_turn(knots: Floats, q: Floats) -> float:
    knots_inside = np.unique(knots)
    r1 = design_matrix(knots, knots_inside, 1) @ q[:, :3]
    t = r1 / np.linalg.norm(r1, axis=1)[:, None]
    return float(np.arccos(np.clip((t[1:] * t[:-1]).sum(axis=1), -1.0, 1.0)).max())


def test_a_corner_beside_its_grasp_falls_as_the_reference_says():
    # a random scene, 29:31, whose finer and finer grids took it up to 0.8 of its length elsewhere
    wire = Cable(length=1.0, diameter=0.005, linear_density=0.2, bending_stiffness=0.2, rest_shape="initial")
    move = Move(displacement=(0.14, 0.12, 0.01), duration=1.2)
    scene = Scene(
        cable=wire,
        shape=Points(points=bend(1.0, np.radians(125), 0.005, 0.406)),
        grasps=(Grasp(u=0.396, path=move),),
        environment=Environment(drag=0.07),
        effects={"self_contact": "off"},
    )
    found = predict(scene)
    known = predict(replace(scene, quality=Quality(method="reference", target_error=12e-3)))  # a third is of the spline
    assert found.status == known.status == "converged"
    assert found.accuracy.error_estimate is not None
    assert known.accuracy.error_estimate is not None
    u, t = samples(scene)
    away = np.linalg.norm(found.surface.positions(u, t) - known.surface.positions(u, t), axis=-1).max()
    assert away < 2.0 * (found.accuracy.error_estimate + known.accuracy.error_estimate)

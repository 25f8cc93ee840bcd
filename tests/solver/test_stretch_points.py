"""Quadrature of the stretch: as many points as the control points have axial strains."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rod import converged
from dlocore import Environment, Grasp, Move, Scene, Straight, predict
from dlocore.problem.discretisation import make_grid
from dlocore.problem.grid import Grid
from dlocore.problem.problem import pose
from tests.solver.scenes import Floats, cable, march, rms, samples

AROUND = Environment(gravity=(0.0, 0.0, 0.0), drag=0.05)
PATH = Move(displacement=(0.0, 0.4, 0.0), rotation=(0.0, 0.0, 0.8), duration=1.0)
GRASPS = {
    "free": (),
    "point": (Grasp(u=0.3, path=Move(displacement=(0.0, 0.4, 0.0), duration=1.0)),),
    "tangent": (Grasp(u=0.3, hold="tangent", path=PATH),),
    "two tangents": (Grasp(u=0.3, hold="tangent", path=PATH), Grasp(u=0.4, hold="tangent", grasp_time=0.5)),
    "tangents at the ends": (
        Grasp(u=0.0, hold="tangent", release_time=0.5),
        Grasp(u=1.0, hold="tangent", grasp_time=0.5),
    ),
}


def grid_of(name: str, n_u: int) -> Grid:
    scene = Scene(cable=cable(), shape=Straight(), grasps=GRASPS[name], environment=AROUND, horizon=1.4)
    return make_grid(pose(scene), n_u)


def strains(grid: Grid) -> Floats:
    """Return the matrix (points, n_u) from control points along a straight cable to strains at the points."""
    tables = grid.tables
    out = np.zeros((len(tables.axial.w), grid.n_u))
    np.put_along_axis(out, tables.axial.first[:, None] + np.arange(4), tables.axial.b1, axis=1)
    return out


@pytest.mark.parametrize("n_u", [8, 9, 13, 33])
@pytest.mark.parametrize("name", GRASPS)
def test_only_a_rigid_shift_costs_no_stretch_energy(name, n_u):
    grid = grid_of(name, n_u)
    matrix = strains(grid)
    assert len(matrix) == n_u - 1  # one more would lock the bending
    singular = np.linalg.svd(matrix, compute_uv=False)
    assert singular[-1] > 0.05 * singular[0] / n_u


@pytest.mark.parametrize("name", GRASPS)
def test_weights_of_the_stretch_points_fill_the_cable(name):
    grid = grid_of(name, 13)
    w = grid.tables.axial.w
    assert w.sum() == pytest.approx(1.0, rel=1e-12)
    assert w.min() > 0
    # a stretch that grows along the cable, on either side of a double knot: exact in all but the graded spans
    at = strains(grid) @ (0.5 * _squares(grid.knots))
    assert w @ at == pytest.approx(0.5, abs=5e-3)


def _squares(knots: Floats) -> Floats:
    """Return the control points of u^2."""
    a, b, c = knots[1:-3], knots[2:-2], knots[3:-1]
    return (a * b + b * c + c * a) / 3.0


@pytest.mark.parametrize(
    ("EI", "grasps", "limit"),
    [
        (1e-2, (Grasp(u=0.5, hold="tangent", path=PATH, release_time=0.6),), 1e-3),
        (1e-3, (Grasp(u=0.3, hold="tangent", path=PATH, release_time=0.6),), 2e-3),
        (1e-3, (Grasp(u=0.0, release_time=0.5), Grasp(u=0.6, hold="tangent", path=PATH, grasp_time=0.5)), 1e-3),
    ],
)
def test_a_held_direction_inside_comes_and_goes_without_a_kink(EI, grasps, limit):
    # a fold at its knot once moved the cable by up to 170 mm, and refining did not help
    made = cable(bending_stiffness=EI, axial_stiffness=640.0)
    scene = Scene(cable=made, shape=Straight(), grasps=grasps, environment=AROUND, horizon=1.4)
    u, t = samples(scene)
    rod = converged(scene, 1e-3)
    assert rod.tolerance_met
    prediction = predict(replace(scene, quality=march(13, 97)))
    surface = prediction.surface
    assert rms(np.linalg.norm(surface.positions(u, t) - rod.positions, axis=-1)) < limit
    near = grasps[-1].u + np.linspace(-1e-3, 1e-3, 5)
    assert np.abs(surface.axial_strain(near, t)).max() < 0.02

"""The angles of the sections that have given twist rates."""

import numpy as np

from dlocore import Cable, Environment, Grasp, Points, Scene
from dlocore.answer.frames import _SMOOTH, angles_of
from dlocore.kernels.basis import Tables
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from tests.solver.scenes import Floats, arc


def over_spans(tables: Tables) -> Floats:
    """Return the matrix (points, points) that takes values to their means over the spans, or to straight lines."""
    first, weights, u = tables.curvature.first, tables.curvature.w, tables.curvature.u
    out = np.zeros((len(u), len(u)))
    spans = np.unique(first)
    for k, span in enumerate(spans):
        own = np.flatnonzero(first == span)
        beside = [abs(spans[j] - span) == 3 for j in (k - 1, k + 1) if 0 <= j < len(spans)]  # a triple knot
        lines = len(beside) == 1 or any(beside)
        basis = np.stack([np.ones(3), u[own] - u[own].mean()][: 2 if lines else 1], axis=1)
        root = np.sqrt(weights[own])
        out[np.ix_(own, own)] = basis @ np.linalg.pinv(root[:, None] * basis) * root
    return out


def test_angles_are_the_smoothest_of_those_with_the_twist_rates():
    scene = Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, rest_shape="initial"),
        shape=Points(points=arc(1.0, 2.0)),
        grasps=(Grasp(u=0.0, hold="clamp"), Grasp(u=0.4, hold="clamp")),
        environment=Environment(drag=0.1),
        effects={"twist": "on"},
        horizon=1.0,
    )
    problem = pose(scene)
    assert problem.twist is not None
    for n_u in (9, 21, 60):
        grid = make_grid(problem, n_u)
        tables, random = grid.tables, np.random.default_rng(n_u)
        rates, first = random.normal(0.0, 1.0, (3, len(tables.curvature.w))), random.normal(0.0, 0.01, 3)
        slopes, bends = np.zeros((2, len(tables.curvature.w), n_u))
        for p, k in enumerate(tables.curvature.first):
            slopes[p, k : k + 4], bends[p, k : k + 4] = tables.curvature.b1[p], tables.curvature.b2[p]
        root = np.sqrt(tables.curvature.w)[:, None]
        widths = np.repeat(tables.curvature.w.reshape(-1, 3).sum(axis=1), 3)[:, None]
        rows = np.concatenate([root * (over_spans(tables) @ slopes), _SMOOTH * widths * root * bends])
        found = angles_of(problem, grid, rates, first)
        for values, rate, given in zip(found, rates, first, strict=True):
            right = np.concatenate([root[:, 0] * problem.twist.radius * rate, np.zeros(len(root))]) - given * rows[:, 0]
            best = np.linalg.lstsq(rows[:, 1:], right)[0]
            assert values[0] == given
            np.testing.assert_allclose(values[1:], best, atol=1e-10 * np.abs(best).max())

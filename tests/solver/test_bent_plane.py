"""Planar motions of cables that are bent without stress leave their plane where their sections would turn over."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, predict
from dlocore.buckling import UNSTABLE
from dlocore.discretisation import make_grid
from dlocore.problem import pose
from dlocore.sideways import _leasts

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0), drag=0.2)
EI, GJ, LENGTH = 0.01, 0.006, 1.0


def arc(angle: float, turned: float = 1.0) -> np.ndarray:
    """Return points of an arc of a length LENGTH that turns by an angle [rad], to a side."""
    s = np.linspace(0.0, angle, 81)
    return LENGTH / angle * np.column_stack([np.sin(s), turned * (1.0 - np.cos(s)), 0.0 * s])


def scene(shape: np.ndarray, rest: Any, *grasps: Grasp, **changes: Any) -> Scene:
    cable = Cable(
        length=LENGTH,
        diameter=0.005,
        linear_density=0.05,
        bending_stiffness=EI,
        torsional_stiffness=GJ,
        rest_shape=rest,
    )
    values: dict[str, Any] = {"environment": WEIGHTLESS, "horizon": 1.0, "grasps": grasps}
    return Scene(cable=cable, shape=Points(points=shape), **(values | changes))


def held(hold: str) -> tuple[Grasp, Grasp]:
    path = Move(displacement=(0.0, 0.0, 0.0), duration=1.0)
    return Grasp(u=0.0, hold=hold, path=path), Grasp(u=LENGTH, hold=hold, path=path)  # type: ignore[arg-type]


def least(posed: Scene) -> float:
    """Return the least stiffness against leaving the plane of the given shape, 0 where there is none below zero."""
    problem = pose(posed)
    grid = make_grid(problem, 33)
    return min(_leasts(problem, grid, grid.start[None], [0.0], 0.0), default=0.0)


@pytest.mark.parametrize(("share", "stays"), [(0.98, True), (1.02, False)])
def test_a_straightened_arc_turns_over_from_the_exact_bend_on(share, stays):
    # straight, with ends clamped, and bent by c without stress, it has for displacements w out of the plane and turns p
    # of the sections the energy EI/2 (w''^2 - 2 c p w'') + GJ/2 p'^2; the least c for which that falls belongs to
    # p = 1 - cos(2 pi u/L), w'' = -c cos(2 pi u/L): c L = 2 pi sqrt(GJ/EI)
    x = np.linspace(0.0, LENGTH, 81)
    straight = np.column_stack([x, 0.0 * x, 0.0 * x])
    angle = share * 2.0 * np.pi * np.sqrt(GJ / EI)
    assert (least(scene(straight, arc(angle)[:, :2], *held("clamp"))) == 0.0) == stays


def test_an_arc_that_is_bent_back_is_solved_in_space():
    shape = arc(1.2)
    posed = scene(shape, arc(1.2, turned=-1.0)[:, :2], *held("tangent"))
    found = predict(posed)
    assert found.accuracy.dimensions == 3
    assert UNSTABLE in found.message
    given = predict(replace(posed, quality=Quality(n_u=17, n_t=33, method="march")))
    assert given.accuracy.dimensions == 2
    assert UNSTABLE in given.message


@pytest.mark.parametrize("rest", ["initial", "straight"])
def test_an_arc_that_stays_is_solved_in_its_plane(rest):
    shape = arc(1.2)
    found = predict(scene(shape, rest, *held("clamp")))
    assert found.accuracy.dimensions == 2
    assert UNSTABLE not in found.message


@pytest.mark.parametrize("turn", [0.0, 0.5 * np.pi, np.pi, 3.0, -2.0])
def test_what_tells_does_not_depend_on_how_far_the_cable_has_turned(turn):
    problem = pose(scene(arc(1.2), arc(1.2, turned=-1.0)[:, :2], *held("tangent")))
    grid = make_grid(problem, 33)
    c, s = np.cos(turn), np.sin(turn)
    given, turned = (
        min(_leasts(problem, grid, (grid.start @ q.T)[None], [0.0], 0.0))
        for q in (np.eye(2), np.array([[c, -s], [s, c]]))
    )
    assert turned == pytest.approx(given, rel=1e-3)
    assert given < 0.0

"""What stands on a table, by its surface or by the height of a cable's middle there, and what a cable slips under."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import (
    Box,
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    predict,
)
from dlocore.effects.distance import distances
from dlocore.problem.notes import edge_notes
from dlocore.problem.problem import pose
from dlocore.problem.standing import obstacle_rows
from dlocore.scene.obstacles import Obstacle
from tests.solver.scenes import Floats, cable

RADIUS = 0.0025
SLIPS = "the cable can slip under its edge. Let it begin at z = 0 m or below"


def peg(base: float) -> Cylinder:
    return Cylinder(center=(0.5, 0.05, base + 0.05), radius=0.02, height=0.1)


def drawn(*obstacles: Obstacle, way: float = 0.2, **changes: object) -> Scene:
    """Return a wire on a table that both ends draw against a peg."""
    grasps = [
        Grasp(u=u, path=Move(displacement=(aside, way, 0.0), duration=2.0)) for u, aside in ((0.0, 0.1), (1.0, -0.1))
    ]
    environment = Environment(table=Table(friction=0.3), obstacles=obstacles)
    scene = Scene(cable=cable(bending_stiffness=2e-3), shape=Straight(), grasps=grasps, environment=environment)
    return replace(scene, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("base", [-RADIUS, -0.001, 0.0])
def test_what_begins_at_the_middle_of_the_cable_or_below_is_solved_in_the_plane(base: float) -> None:
    problem = pose(drawn(peg(base)))
    assert problem.on_table
    assert edge_notes(problem.scene, problem.obstacles) == []


def test_in_space_the_cable_goes_as_in_the_plane_along_walls_that_begin_at_its_middle() -> None:
    quality = Quality(target_error=0.001)
    flat = predict(drawn(peg(0.0), quality=quality))
    space = predict(drawn(peg(0.0), quality=quality, effects={"table": "on"}))
    assert (flat.accuracy.dimensions, space.accuracy.dimensions) == (2, 3)
    places: list[Floats] = [p.surface.positions(np.linspace(0, 1, 41), np.linspace(0, 2, 21)) for p in (flat, space)]
    assert np.linalg.norm(places[1] - places[0], axis=2).max() < 0.001
    assert np.abs(places[1][..., 2]).max() < 0.01 * RADIUS


@pytest.mark.parametrize("base", [1e-4, 0.001, 0.0024])
def test_what_begins_between_the_middle_and_the_top_of_the_cable_is_told_of(base: float) -> None:
    problem = pose(drawn(peg(base)))
    assert not problem.on_table
    (note,) = edge_notes(problem.scene, problem.obstacles)
    assert note.startswith(f"obstacles[0] begins {1e3 * (base + RADIUS):.2g} mm above the surface of the table")
    assert note.endswith(SLIPS)


@pytest.mark.parametrize(
    "obstacle",
    [
        peg(0.006),
        Box(center=(0.5, 0.1, 0.051), size=(0.1, 0.1, 0.1), orientation=(0.9238795, 0.3826834, 0.0, 0.0)),
        Cylinder(center=(0.5, 0.05, 0.03), radius=0.02, height=0.1, axis=(1.0, 0.0, 0.0)),
    ],
    ids=["high", "turned", "lying"],
)
def test_what_a_cable_passes_below_or_is_not_upright_is_not_told_of(obstacle: Obstacle) -> None:
    assert edge_notes(drawn(obstacle), (obstacle,)) == []


def test_nothing_slips_under_what_stands_where_the_table_is_off() -> None:
    off = drawn(peg(0.001), effects={"table": "off"})
    assert edge_notes(off, off.environment.obstacles) == []
    assert edge_notes(replace(off, effects={}), off.environment.obstacles) != []


def test_the_note_is_told_with_the_prediction_and_names_the_obstacle() -> None:
    far = Cylinder(center=(0.0, -5.0, 0.051), radius=0.02, height=0.1)  # which the cable does not come near
    scene = drawn(far, peg(0.001), quality=Quality(n_u=9, n_t=13, estimate=False), way=0.1)
    told = [note for note in predict(scene).notes if SLIPS in note]
    assert len(told) == 1
    assert told[0].startswith("obstacles[1] begins 3.5 mm above the surface of the table")


@pytest.mark.parametrize("base", [-0.05, -RADIUS, 0.0])
def test_a_start_through_what_stands_on_the_table_is_refused_whichever_height_it_begins_at(base: float) -> None:
    through = Cylinder(center=(0.5, 0.0, base + 0.05), radius=0.02, height=0.1)
    with pytest.raises(SceneError, match=r"environment.obstacles\[0\]: got 0.0225 m inside"):
        pose(drawn(through))


@pytest.mark.parametrize(
    "obstacle",
    [
        Cylinder(center=(0.5, 0.1, 0.05), radius=0.02, height=0.1),
        Capsule(start=(0.5, 0.1, 0.1), end=(0.5, 0.1, 0.0), radius=0.02),
        Box(center=(0.5, 0.1, 0.05), size=(0.1, 0.04, 0.1)),
        Box(center=(0.5, 0.1, 0.05), size=(0.1, 0.04, 0.1), orientation=(0.5**0.5, 0.0, 0.5**0.5, 0.0)),
    ],
    ids=["cylinder", "capsule", "box", "turned box"],
)
def test_walls_go_on_below_the_table_and_are_elsewhere_where_they_were(obstacle: Obstacle) -> None:
    scene = drawn(obstacle)
    points = np.random.default_rng(1).uniform((0.4, 0.0, 0.0), (0.6, 0.2, 0.04), (200, 3))
    given, lower = obstacle.row()[None], obstacle_rows(scene, [obstacle])
    outside = distances(given, points)[:, 0] > 0.0
    np.testing.assert_allclose(distances(lower, points)[outside], distances(given, points)[outside], atol=1e-15)
    middle = np.array([[0.5, 0.1, 0.0]])  # 20 mm or more from each wall
    assert distances(lower, middle) <= -0.02
    np.testing.assert_array_equal(obstacle_rows(replace(scene, environment=Environment()), [obstacle]), given)

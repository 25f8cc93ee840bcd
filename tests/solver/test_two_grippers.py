"""Two grippers and gravity, in three dimensions; and the plane as a special case of space."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.rod import converged
from benchmarks.rod import equilibrium as rod_equilibrium
from dlocore import ControlPoints, Environment, Grasp, Move, Points, Quality, Scene, equilibrium, predict
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from tests.solver.scenes import Floats, arc, cable, march, paper_scene, refined, samples, without_table

LIFT = Move(displacement=(-0.2, 0.2, 0.1), duration=1.0)
HANGING = [
    [0.0, 0.0, 0.0], [0.067, 0.0, -0.039], [0.115, 0.0, -0.115], [0.153, 0.0, -0.185], [0.201, 0.0, -0.249],
    [0.273, 0.0, -0.303], [0.35, 0.0, -0.32], [0.427, 0.0, -0.303], [0.499, 0.0, -0.249], [0.547, 0.0, -0.185],
    [0.585, 0.0, -0.115], [0.633, 0.0, -0.039], [0.7, 0.0, -0.0],
]  # fmt: skip


def hanging(hold: str) -> Scene:
    """Return a cable that hangs between two grippers 0.7 m apart, of which one moves in 3D."""
    grasps = (Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=LIFT))  # type: ignore[arg-type]
    return Scene(
        cable=cable(),
        shape=Points(points=HANGING, settle=True),
        grasps=grasps,
        environment=Environment(drag=0.1),
        quality=Quality(target_error=2e-3),
    )


def for_the_rod(scene: Scene) -> Scene:
    """Return the scene with its start as control points, which the rod takes, and whose tangents the grippers hold.

    They are in material coordinates, as the rod has them, and so lie where they do on the grid.
    """
    problem = pose(scene)
    grid = make_grid(problem, 25)
    world = problem.plane.world(grid.start)
    shape = ControlPoints(control_points=world, knots=grid.knots, strain=np.zeros(len(world)), settle=True)
    return replace(scene, shape=shape)


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_motion_in_space_agrees_with_the_independent_rod(hold):
    scene = for_the_rod(hanging(hold))
    u, t = samples(scene)
    rod = converged(scene, 3e-4, times=t)
    assert rod.tolerance_met
    for target in (2e-3, 5e-4):
        prediction = refined(scene, target)
        assert prediction.accuracy.dimensions == 3
        worst = np.linalg.norm(prediction.surface.positions(u, t) - rod.positions, axis=-1).max()
        assert worst < target


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_start_of_hanging_cable_agrees_with_the_independent_rod(hold):
    scene = for_the_rod(hanging(hold))
    (u, coarse), (_, fine) = (rod_equilibrium(scene, elements=n) for n in (80, 160))
    exact = (4 * fine[::2] - coarse) / 3
    np.testing.assert_allclose(
        equilibrium(scene, n_u=49).positions(u), exact, atol=1e-5
    )  # measured: 5e-6; fourth order


def planar() -> Scene:
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=0.7, path=Move(displacement=(-0.1, 0.0, 0.15), duration=0.8)))
    return Scene(
        cable=cable(),
        shape=Points(points=arc(1.0, 1.0)[:, [0, 2, 1]]),
        grasps=grasps,
        environment=Environment(drag=0.2, drag_quadratic=0.1),
        quality=march(17, 33),
    )


@pytest.mark.parametrize(
    ("method", "damping", "limit"),
    [
        ("march", 0.0, 1e-6),
        ("spacetime", 0.0, 1e-6),
        # the Newton iteration in space leaves out how the damping's direction turns: it ends elsewhere in its tolerance
        ("march", 1e-4, 3e-5),
    ],
)
def test_space_and_plane_agree_on_a_planar_scene(method, damping, limit):
    # a push out of the plane by 1e-7 m makes the scene spatial
    quality = march(17, 33, method=method, delta=1e-6)
    scene = replace(planar(), cable=cable(bending_damping=damping), quality=quality)
    aside = Move(displacement=(-0.1, 1e-7, 0.15), duration=0.8)
    spatial = replace(scene, grasps=(scene.grasps[0], replace(scene.grasps[1], path=aside)))
    a, b = predict(scene), predict(spatial)
    assert a.status == b.status == "converged"
    assert (a.accuracy.dimensions, b.accuracy.dimensions) == (2, 3)
    u, t = samples(a.surface)
    difference = (a.surface.positions(u, t) - b.surface.positions(u, t))[..., [0, 2]]
    assert np.abs(difference).max() < limit


def test_a_scene_in_a_tilted_plane_is_planar_and_the_same():
    def tilted(turn: Floats) -> Scene:
        scene = without_table(paper_scene(0.25))
        path = Move(displacement=turn @ [0.0, 0.5, 0.0], duration=1.6)
        shape = replace(scene.shape, direction=turn[:, 0])  # type: ignore[type-var]
        return replace(scene, shape=shape, grasps=(Grasp(u=0.25, path=path),))

    turn = Rotation.from_rotvec([0.4, -1.1, 0.3]).as_matrix()
    flat, oblique = predict(tilted(np.eye(3))), predict(tilted(turn))
    assert oblique.accuracy.dimensions == 2
    u, t = samples(flat.surface)
    np.testing.assert_allclose(oblique.surface.positions(u, t), flat.surface.positions(u, t) @ turn.T, atol=1e-6)

"""The fast explicit rod that the predictor is compared with (benchmarks/peers) solves the same equations."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import rod
from benchmarks.peers.cases import SAMPLES_T, SAMPLES_U, hanging, planar
from benchmarks.peers.explicit import extrapolated, simulated
from dlocore import Cable, Environment, Grasp, Move, Scene, Straight

WEIGHTLESS = (0.0, 0.0, 0.0)
U = np.linspace(0.0, 1.0, SAMPLES_U)


def converged(scene: Scene) -> np.ndarray:
    """Return positions (33, 101, 3) [m] by the judging rod, within 0.03 mm."""
    found = rod.converged(scene, 3e-5, samples_u=SAMPLES_U, times=np.linspace(0.0, scene.horizon or 0.0, SAMPLES_T))
    assert found.tolerance_met
    return found.positions


def worst(scene: Scene, motion: tuple[np.ndarray, np.ndarray], truth: np.ndarray) -> float:
    """Return the largest distance [m] of a motion at nodes to sampled positions."""
    return float(np.linalg.norm(rod.sample(scene, *motion, U) - truth, axis=-1).max())


@pytest.mark.parametrize("grasp", [0.0, 0.25])
def test_it_converges_to_the_judging_rod_with_order_two_and_extrapolated_much_faster(grasp):
    scene = planar(1e-3, grasp)
    truth = converged(scene)
    plain = [worst(scene, simulated(scene, n), truth) for n in (20, 40, 80)]
    orders = np.log2(np.divide(plain[:-1], plain[1:]))
    assert ((orders > 1.7) & (orders < 2.3)).all()  # two in the limit
    assert worst(scene, extrapolated(scene, 80), truth) < 0.1 * plain[-1]
    assert worst(scene, extrapolated(scene, 80), truth) < 1e-4  # 0.03 of the reference, the rest of order h^4


def test_in_space_it_converges_to_the_judging_rod():
    scene = hanging()
    error = worst(scene, extrapolated(scene, 64), converged(scene))
    # the start is an equilibrium of the spline: what the nodes miss of it swings, 0.1 mm here
    assert error < 3e-4


def test_a_tilted_plane_changes_nothing():
    def moved(direction: tuple[float, float, float]) -> np.ndarray:
        path = Move(displacement=0.4 * np.array(direction), duration=0.8)
        scene = replace(planar(1e-3, 0.25), grasps=(Grasp(u=0.25, path=path),), horizon=0.8)
        return simulated(scene, 20)[1]

    flat, tilted = moved((0.0, 1.0, 0.0)), moved((0.0, 0.6, 0.8))
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.0, -0.8, 0.6]])
    assert np.ptp(flat[-1, :, 2]) == 0.0
    np.testing.assert_allclose(tilted, flat @ turn, atol=1e-11)  # the same sums in two and three coordinates


def test_drag_brakes_a_cable_that_falls():
    mu, drag, g = 0.05, 0.1, 9.81
    cable = Cable(length=1.0, diameter=0.005, linear_density=mu, bending_stiffness=1e-3)
    around = Environment(gravity=(0.0, 0.0, -g), drag=drag)
    scene = Scene(cable=cable, shape=Straight(), environment=around, horizon=1.0)
    z = simulated(scene, 20)[1][-1, :, 2]
    rate = drag / mu
    exact = -g / rate * (1.0 - (1.0 - np.exp(-rate)) / rate)
    np.testing.assert_allclose(z, exact, atol=3e-6)  # steps of 0.4 ms: (rate dt)^2/12 of a way of 3 m


def test_held_nodes_follow_their_paths():
    scene = hanging()
    _, positions = simulated(scene, 16)
    t = np.linspace(0.0, 1.0, SAMPLES_T)
    for grasp, node in zip(scene.grasps, (0, -1), strict=True):
        exact = grasp.path.at(t, positions[0, node])
        np.testing.assert_allclose(positions[:, node], exact, atol=1e-12)

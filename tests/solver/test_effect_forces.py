"""How large the forces of each effect are in a motion, where they are known in closed form."""

import numpy as np
import pytest

from dlocore import Environment, Scene, Straight, effect_forces, predict
from tests.solver.scenes import WEIGHTLESS, G, cable, march

SPEED, DRAG = 0.3, 0.05  # [m/s], [N s/m^2]
MASS = 0.05  # [kg]
# what a unit force along the cable is at its nine control points on uniform knots: a load along it adds up to the same
SHARES = np.array([1, 2, 3, 4, 4, 4, 3, 2, 1]) / 24.0


def thrown(environment: Environment, velocity: tuple[float, float, float]) -> Scene:
    """Return a straight cable that no gripper holds."""
    start = Straight(velocity=velocity)
    return Scene(cable=cable(), shape=start, environment=environment, horizon=0.5, quality=march(9, 13))


def test_the_drag_of_a_cable_that_drifts_is_that_of_its_speed_and_its_mean_over_times() -> None:
    drifting = thrown(Environment(gravity=WEIGHTLESS.gravity, drag=DRAG), (0.0, SPEED, 0.0))
    surface = predict(drifting).surface
    once = effect_forces(drifting, surface, [0.0])
    assert once["drag"] == pytest.approx(DRAG * SPEED * np.linalg.norm(SHARES), rel=1e-6)
    assert effect_forces(drifting, surface, [0.0, 0.0]) == pytest.approx(once)
    later = [effect_forces(drifting, surface, [t])["drag"] for t in (0.0, 0.5)]
    assert later[1] < 0.7 * later[0]
    assert effect_forces(drifting, surface, [0.0, 0.5])["drag"] == pytest.approx(np.sqrt(np.mean(np.square(later))))


def test_in_free_fall_inertia_is_as_large_as_gravity() -> None:
    falling = thrown(Environment(), (0.0, 0.0, 0.0))
    forces = effect_forces(falling, predict(falling).surface, [0.1, 0.2, 0.4])
    assert forces["gravity"] == pytest.approx(MASS * G * np.linalg.norm(SHARES))
    assert forces["inertia"] == pytest.approx(forces["gravity"], rel=1e-6)
    assert max(forces["stretch"], forces["bend"]) < 1e-6 * forces["gravity"]

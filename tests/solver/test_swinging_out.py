"""A path that is refused says when, and whether it is its spline that swings out there between waypoints."""

from typing import Any

import numpy as np
import pytest

from dlocore import Box, Environment, Grasp, Scene, SceneError, Straight, Table, Waypoints
from dlocore.problem.problem import pose
from tests.solver.scenes import cable

TIMES = [0.0, 1.0, 2.0, 3.0, 4.0]
LIFTED = [(0, 0, 0), (0, 0.3, 0), (0, 0.3, 0), (0, 0.3, 0), (0, 0.3, 0.2)]
LOWERED = [(0, 0, 0), (0, 0.3, 0), (0, 0.3, -0.02), (0, 0.3, 0), (0, 0.3, 0.2)]
SWINGS = "where a smooth path swings out between its waypoints: a profile that stops at each"


def refused(positions: Any, *more: Grasp, times: Any = TIMES, u: float = 0.0, **around: Any) -> tuple[str, float]:
    """Return why a cable that is led so is refused, and at what time it says [s]."""
    led = Grasp(u=u, path=Waypoints(times=times, positions=positions))
    environment = Environment(drag=0.1, **around)
    with pytest.raises(SceneError, match=r"primitives\[.\].path") as caught:
        pose(Scene(cable=cable(), shape=Straight(), grasps=[led, *more], environment=environment))
    return str(caught.value), float(str(caught.value).split(" at ")[1].split(" s")[0])


def stopping(positions: Any, **around: Any) -> None:
    """Pose the cable that is led so, and stops at each waypoint."""
    path = Waypoints(times=TIMES, positions=positions, profile="minimum_jerk")
    pose(Scene(cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0, path=path)], environment=Environment(**around)))


def test_a_path_that_swings_into_the_table_says_when_and_what_keeps_it_out() -> None:
    why, when = refused(LIFTED, table=Table())
    t = np.linspace(0.0, 4.0, 4001)
    path = Waypoints(times=TIMES, positions=LIFTED).at(t, np.zeros(3))
    assert when == pytest.approx(t[path[:, 2].argmin()], abs=0.03)
    assert SWINGS in why
    stopping(LIFTED, table=Table())


def test_a_path_whose_waypoint_is_in_the_table_says_when_alone() -> None:
    why, when = refused(LOWERED, table=Table())
    assert 2.0 <= when < 3.0
    assert SWINGS not in why


@pytest.mark.parametrize(("edge", "swings"), [(0.315, True), (0.28, False)])
def test_a_path_into_an_obstacle_says_when_and_whether_it_swings_there(edge: float, swings: bool) -> None:
    box = Box(center=(0.0, edge + 0.05, 0.0), size=(0.1, 0.1, 0.1))
    back = [(0, 0, 0), (0, 0.3, 0), (0, 0.3, 0), (0, 0.3, 0), (0, 0, 0)]
    why, when = refused(back, table=Table(), obstacles=(box,))
    path = Waypoints(times=TIMES, positions=back).at(np.array([when]), np.zeros(3))[0]
    told = float(why.split("got ")[1].split(" m")[0])
    assert told == pytest.approx(path[1] + 0.0025 - edge, abs=3e-3)  # the time is told to 3 digits
    assert (SWINGS in why) == swings
    if swings:
        stopping(back, table=Table(), obstacles=(box,))


def test_a_start_in_an_obstacle_says_where_along_the_cable() -> None:
    box = Box(center=(0.7, 0.0, 0.0), size=(0.1, 0.1, 0.1))
    environment = Environment(table=Table(), obstacles=(box,))
    with pytest.raises(SceneError, match=r"The cable starts up to .* m inside it, at u = 0\.[67]"):
        pose(Scene(cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0)], environment=environment, horizon=1.0))


def test_a_spline_that_swings_out_of_reach_says_so() -> None:
    times = [0.0, 1.0, 1.2, 2.0, 3.0]
    why, when = refused([(0, 0, 0), (0.01, 0, 0), (0, 0, 0), (0, 0, 0), (0.01, 0, 0)], Grasp(u=1.0), times=times)
    assert 1.2 < when < 2.0
    assert SWINGS in why
    why, _ = refused([(0, 0, 0), (0.01, 0, 0), (-0.2, 0, 0), (0, 0, 0), (0.01, 0, 0)], Grasp(u=1.0), times=times)
    assert SWINGS not in why

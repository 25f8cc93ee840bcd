"""The cable does not pass through itself, and feels nothing of itself while its strands are apart."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.hard.generator import draw
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    predict,
)
from dlocore.effects.selfcontact import APART
from dlocore.levels.level import distance, run_level
from dlocore.problem.problem import pose
from dlocore.solvers.monitor import Monitor

Floats = NDArray[np.float64]
DIAMETER = 0.005  # [m]
WEIGHTLESS = (0.0, 0.0, 0.0)


def lengths(points: Floats) -> Floats:
    """Return the arc lengths (k,) [m] of points (k, 3) from the first."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def overhand_knot(tail: float = 0.15) -> Floats:
    """Return points (161, 3) [m] of an open trefoil with straight tails, (t^3 - 3t, t^4 - 4t^2, t^5/5 - 2t)."""
    t = np.linspace(-2.0, 2.0, 161)
    curve = 0.03 * np.column_stack([t**3 - 3 * t, t**4 - 4 * t**2, 0.5 * (t**5 / 5 - 2 * t)])
    first, last = curve[0] - curve[1], curve[-1] - curve[-2]
    s = np.linspace(0.0, tail, 30)[1:, None]
    points = np.concatenate(
        [curve[0] + s[::-1] * first / np.linalg.norm(first), curve, curve[-1] + s * last / np.linalg.norm(last)]
    )
    along = lengths(points)
    even = np.linspace(0.0, along[-1], 161)
    return np.column_stack([np.interp(even, along, points[:, d]) for d in range(3)])


def knot_scene(effect: str, twist: str = "auto") -> Scene:
    """Return the scene of a loose overhand knot that two grippers pull tight.

    Without twist it starts as a straight cable bent to a knot, with it free of stress.
    """
    points = overhand_knot()
    length = float(lengths(points)[-1])
    cable = Cable(
        length=length,
        diameter=DIAMETER,
        linear_density=0.05,
        bending_stiffness=1e-3,
        bending_damping=1e-4,
        rest_shape="straight" if twist == "off" else "initial",
    )
    pulls = [Move(displacement=(side * 0.18, 0.0, 0.0), duration=2.0) for side in (-1, 1)]
    return Scene(
        cable=cable,
        shape=Points(points=points),
        grasps=(Grasp(u=0.0, path=pulls[0]), Grasp(u=length, path=pulls[1])),
        environment=Environment(gravity=WEIGHTLESS, drag=0.5),
        horizon=2.5,
        effects={"self_contact": effect, "twist": twist},
        quality=Quality(n_u=49, n_t=61, method="march", estimate=False),
    )


def fold_scene(effect: str, planar: bool, duration: float) -> Scene:
    """Return the scene of a U whose one leg a gripper moves 16 cm across the other, whose end is held."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 41)
    leg = np.linspace(-0.35, 0.0, 41)[:-1]
    points = np.concatenate(
        [
            np.column_stack([leg, np.full(40, -0.04)]),
            0.04 * np.column_stack([np.cos(turn), np.sin(turn)]),
            np.column_stack([leg[::-1], np.full(40, 0.04)]),
        ]
    )
    out = 0.0 if planar else 0.002  # [m] out of the plane, in which the legs would else meet exactly
    points = np.column_stack([points, out * np.sin(np.linspace(0.0, 9.0, len(points)))])
    length = float(lengths(points)[-1])
    cable = Cable(length=length, diameter=DIAMETER, linear_density=0.05, bending_stiffness=1e-3, bending_damping=1e-4)
    across = Move(displacement=(0.0, 0.16, 0.0), duration=duration)
    around = Environment(drag=0.3, table=Table()) if planar else Environment(gravity=WEIGHTLESS, drag=0.3)
    return Scene(
        cable=cable,
        shape=Points(points=points),
        grasps=(Grasp(u=0.2, path=across), Grasp(u=length, hold="tangent")),
        environment=around,
        horizon=1.25 * duration,
        effects={"self_contact": effect, "twist": "off"},
        quality=Quality(n_u=33, n_t=121, method="march", estimate=False),  # knots enough to follow a strike
    )


def strands_apart(prediction: Prediction, k_t: int = 121) -> Floats:
    """Return at k_t times the smallest distance of two strands in diameters, from points an eighth of one apart.

    Between such points strands that cross come nearer by less than (1/16)^2, 0.4 %, of a diameter.
    """
    surface = prediction.surface
    u = np.linspace(0.0, surface.length, 1 + round(8 * surface.length / DIAMETER))
    strands = np.abs(u[:, None] - u[None]) > APART * DIAMETER
    apart = []
    for x in surface.positions(u, np.linspace(0.0, surface.horizon, k_t)):
        square = (x * x).sum(axis=1)
        distance = square[:, None] + square[None] - 2.0 * x @ x.T
        apart.append(float(np.sqrt(max(0.0, distance[strands].min()))) / DIAMETER)
    return np.array(apart)


# Contact may be DEEPEST = 3 % deep; chords between nodes a diameter apart and the drawing of closest points to the
# middles of segments (1.2 %) take the rest.
NEAREST = 0.95


def test_an_overhand_knot_pulled_tight_does_not_pass_through_itself() -> None:
    prediction = predict(knot_scene("on"))
    assert prediction.status == "converged", prediction.message
    assert strands_apart(prediction).min() >= NEAREST
    # the ends are where an unknotted cable would be nearly straight: the knot is what holds it
    assert strands_apart(prediction)[-1] < 1.05


def test_without_the_effect_the_knot_falls_apart() -> None:
    apart = strands_apart(predict(knot_scene("off")))
    assert apart.min() < 0.3, "strands pass through each other, so that the scene tests what it says"


@pytest.mark.parametrize("duration", [1.0, 0.3], ids=["slow", "fast"])
@pytest.mark.parametrize("planar", [True, False], ids=["plane", "space"])
def test_a_leg_pushed_across_the_other_does_not_pass_through_it(planar: bool, duration: float) -> None:
    prediction = predict(fold_scene("on", planar, duration))
    assert prediction.status == "converged", prediction.message
    assert prediction.accuracy.dimensions == (2 if planar else 3)
    assert strands_apart(prediction).min() >= NEAREST
    assert strands_apart(predict(fold_scene("off", planar, duration))).min() < 0.3, "it would without the effect"


@pytest.mark.parametrize("table", [Table(), None], ids=["plane", "space"])
def test_strands_apart_feel_nothing(table: Table | None) -> None:
    scene = Scene(
        cable=Cable.preset("paper"),
        shape=Straight(),
        grasps=(Grasp(u=0.25, path=Move(displacement=(0.0, 0.5, 0.1 * (table is None)), duration=1.6)),),
        environment=Environment(drag=0.05, table=table),
        quality=Quality(n_u=13, n_t=19, method="march", estimate=False),
    )
    motions = [predict(replace(scene, effects={"self_contact": switch})) for switch in ("on", "off")]
    assert [e.active for m in motions for e in m.effects if e.name == "self_contact"] == [True, False]
    # the same steps with the same numbers: no tolerance
    assert np.array_equal(motions[0].surface.control_points, motions[1].surface.control_points)


def test_strands_that_strike_do_so_alike_on_every_grid() -> None:
    # segments that were as long as the spans allow moved this motion by 0.6 to 2.5 % of the length, however fine
    scene = draw(18, 484).make()
    problem = pose(scene, {"self_contact": "its strands meet"})
    levels = [run_level(problem, n_u, 120, 2560, Monitor()) for n_u in (96, 144, 216)]
    assert all(not level.motion.stopped and level.motion.deepest > 0.0 for level in levels)
    first, second = (distance(a, b) for a, b in pairwise(levels))
    assert second < 0.6 * first  # 1/1.5^2 and less
    assert second < 0.005 * scene.cable.length


# --- the choice


def near_start(apart: float) -> Scene:
    """Return the planar U with legs `apart` [m]."""
    scene = fold_scene("auto", True, 1.0)
    points = np.array(scene.shape.points)  # type: ignore[union-attr]
    points *= apart / 0.08
    cable = replace(scene.cable, length=float(lengths(points)[-1]), axial_stiffness=None)
    held = (Grasp(u=0.0), Grasp(u=cable.length))
    free = Environment(gravity=WEIGHTLESS, drag=0.3)
    return replace(
        scene, cable=cable, shape=Points(points=points), grasps=held, environment=free, effects={"self_contact": "auto"}
    )


def test_strands_that_start_close_are_kept_apart_without_asking() -> None:
    close, far = pose(near_start(1.8 * DIAMETER)), pose(near_start(0.08))
    assert close.choices["self_contact"].active
    assert "strands of the start" in close.choices["self_contact"].reason
    assert not far.choices["self_contact"].active
    assert far.self_contact is None
    off = pose(replace(near_start(1.8 * DIAMETER), effects={"self_contact": "off"}))
    assert off.self_contact is None


def wound(turns: float, pitch: float) -> Scene:
    """Return a cable of a metre wound to so many turns, each `pitch` [m] above the one before."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 161)
    radius = 1.0 / np.hypot(2.0 * np.pi * turns, pitch * turns)
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle / (2.0 * np.pi)])
    cable = Cable(length=1.0, diameter=DIAMETER, linear_density=0.05, bending_stiffness=1e-3)
    return Scene(
        cable=cable,
        shape=Points(points=points),
        grasps=(Grasp(u=0.0),),
        horizon=1.0,
        effects={"self_contact": "on"},
    )


def test_strands_that_lie_in_each_other_are_pressed_apart_until_they_pass_through() -> None:
    assert pose(wound(1.5, 0.2 * DIAMETER)).self_contact is not None
    with pytest.raises(SceneError, match=r"shape: got two strands 0\.0002 m apart\. The start passes through itself"):
        pose(wound(1.5, 0.04 * DIAMETER))


@pytest.mark.parametrize("table", [None, Table()])
def test_the_ends_of_a_ring_may_meet(table: Table | None) -> None:
    ring = replace(wound(1.0, 0.0), environment=Environment(table=table))
    assert pose(ring).self_contact is not None


def test_on_a_table_strands_may_lie_over_each_other_and_the_message_says_so() -> None:
    lies = replace(near_start(1.8 * DIAMETER), environment=Environment(drag=0.3, table=Table()))
    assert pose(lies).self_contact is None
    crossing = fold_scene("auto", True, 1.0)
    assert "one lies over the other" in predict(crossing).message

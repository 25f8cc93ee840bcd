"""Notes on a scene as it was given, whatever its motion."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Points,
    Quality,
    Scene,
    Straight,
    Table,
    Waypoints,
    equilibrium,
    predict,
)
from dlocore.problem.notes import scene_notes
from dlocore.scene.cable import PRESETS
from dlocore.scene.scene import Hold
from tests.solver.scenes import Floats, arc, cable

HOLD = Grasp(u=0.0)


def along(points: Floats) -> Scene:
    """Return the scene of a cable of 1 m that is seen at these points."""
    return Scene(cable=cable(), shape=Points(points=points), grasps=[HOLD], horizon=0.1)


def straight(length: float) -> Floats:
    return np.linspace(0.0, length, 40)[:, None] * [1.0, 0.0, 0.0]


@pytest.mark.parametrize(("target", "told"), [(5e-4, True), (None, False)])
def test_a_start_that_misses_what_its_points_show_is_told_of(target: float | None, told: bool) -> None:
    # more waves of 1 mm than a fit has spans, at twenty points each: it goes through their middle, 0.7 mm from them
    s = np.linspace(0.0, 1.0, 2000)
    waves = np.column_stack([s, 1e-3 * np.sin(200.0 * np.pi * s), 0.0 * s])
    notes = scene_notes(replace(along(waves), quality=Quality(target_error=target)))
    assert len(notes) == told
    assert all("a smooth curve that misses the points of the shape by 0.69 mm" in note for note in notes)


@pytest.mark.parametrize("length", [0.91, 1.05])
def test_points_of_another_length_than_the_cable_are_told_of_with_how_far_the_ends_moved(length: float) -> None:
    prediction = predict(along(straight(length)))
    (note,) = prediction.notes
    moved = 0.5 * abs(1.0 - length)
    assert f"{length:.4g} m long and the cable 1 m" in note
    assert f"moves an end by up to {1e3 * moved:.2g} mm" in note
    assert note in prediction.message
    begins = prediction.surface.positions([0.0], [0.0])[0, 0]
    assert np.linalg.norm(begins) == pytest.approx(moved, rel=1e-6)


def test_an_equilibrium_tells_of_points_of_another_length_too() -> None:
    assert "0.95 m long and the cable 1 m" in equilibrium(along(straight(0.95))).message


def test_the_reference_tells_of_points_of_another_length_too() -> None:
    quality = Quality(method="reference", target_error=0.02)
    scene = Scene(cable=cable(), shape=Points(points=straight(0.95)), grasps=[HOLD], horizon=0.02, quality=quality)
    assert "0.95 m long and the cable 1 m" in predict(scene).message


@pytest.mark.parametrize("length", [1.0, 1.0 + 1e-9, 0.996, 1.004])
def test_points_as_long_as_the_cable_but_for_rounding_are_not_told_of(length: float) -> None:
    assert scene_notes(along(straight(length))) == []


@pytest.mark.parametrize("seed", range(5))
def test_points_that_only_noise_makes_longer_are_not_told_of(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(scale=0.003, size=(100, 3))
    points = arc(1.0, 2.5, 100) + noise
    assert scene_notes(along(points)) == []


def test_a_straight_cable_has_nothing_to_be_told_of() -> None:
    assert scene_notes(Scene(cable=cable(), shape=Straight(), grasps=[HOLD], horizon=1.0)) == []


def test_a_cable_that_is_lighter_than_air_is_asked_whether_it_is_in_millimetres() -> None:
    wire = Cable(length=1000.0, diameter=5.0, linear_density=0.05, bending_stiffness=1e-3)
    (note,) = scene_notes(Scene(cable=wire, shape=Straight(), grasps=[HOLD], horizon=1.0))
    assert "5 m thick and weighs 0.05 kg/m" in note
    assert "may be in millimetres" in note


def test_a_cable_that_is_heavier_than_metal_is_told_what_its_density_is() -> None:
    cord = Cable(length=1.0, diameter=0.005, linear_density=1.2, bending_stiffness=1e-3)  # meant as g/cm^3
    (note,) = scene_notes(Scene(cable=cord, shape=Straight(), grasps=[HOLD], horizon=1.0))
    assert "0.005 m thick and weighs 1.2 kg/m" in note
    assert "mass per length in kg/m" in note


def test_a_cable_of_the_heaviest_metal_is_not_told_of() -> None:
    tungsten = Cable(length=1.0, diameter=0.001, linear_density=0.0157, bending_stiffness=1e-3)  # 2e4 kg/m^3
    assert scene_notes(Scene(cable=tungsten, shape=Straight(), grasps=[HOLD], horizon=1.0)) == []


@pytest.mark.parametrize(
    ("hold", "rotation", "told"),
    [("tangent", (3.0, 0.0, 0.0), True), ("tangent", (0.0, 0.0, 0.3), False), ("clamp", (3.0, 0.0, 0.0), False)],
)
def test_a_turn_about_the_cable_that_is_held_by_its_direction_alone_is_told_of(
    hold: Hold, rotation: tuple[float, float, float], told: bool
) -> None:
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=rotation, duration=1.0)
    scene = Scene(cable=cable(), shape=Straight(), grasps=[HOLD, Grasp(u=1.0, hold=hold, path=turn)])
    assert any("primitives[1] turns about the cable" in note for note in scene_notes(scene)) == told


@pytest.mark.parametrize("name", PRESETS)
def test_real_cables_are_not_asked_for_their_unit(name: str) -> None:
    assert scene_notes(Scene(cable=Cable.preset(name), shape=Straight(), grasps=[HOLD], horizon=1.0)) == []


@pytest.mark.parametrize("closes", [1.0, 3.0])
def test_a_gripper_that_closes_after_the_horizon_is_told_of(closes: float) -> None:
    late = Grasp(u=1.0, grasp_time=closes)
    prediction = predict(Scene(cable=cable(), shape=Straight(), grasps=[HOLD, late], horizon=1.0))
    note = f"primitives[1] never holds the cable: it closes at {closes:g} s and the horizon is 1 s"
    assert prediction.notes == (note,)
    assert not prediction.grasps[1].reaction.any()


def test_a_gripper_that_closes_before_the_horizon_is_not_told_of() -> None:
    late = Grasp(u=1.0, grasp_time=0.9, release_time=3.0)
    assert scene_notes(Scene(cable=cable(), shape=Straight(), grasps=[HOLD, late], horizon=1.0)) == []


@pytest.mark.parametrize(
    ("stiffness", "told"),
    [(None, "by up to 6% along itself, with the 39.1 N of a solid section"), (40.0, "6%"), (1e4, "")],
)
def test_a_strain_of_a_cable_whose_axial_stiffness_is_assumed_is_told_of_with_it(
    stiffness: float | None, told: str
) -> None:
    # 10 m of a soft wire hang from one end; their weight alone strains them by 4 %
    wire = Cable.preset("white-wire", length=10.0, axial_stiffness=stiffness)
    hanging = Scene(cable=wire, shape=Straight(direction=(0.0, 0.0, -1.0)), grasps=[HOLD], horizon=1.0)
    notes = predict(hanging).notes
    assert ("give axial_stiffness if it differs" in "".join(notes)) == (stiffness is None)
    assert told in "".join(notes)
    assert bool(notes) == bool(told)


@pytest.mark.parametrize("stiffness", [None, 40.0])
def test_a_strain_that_real_cables_bear_is_told_of_where_the_axial_stiffness_is_assumed(
    stiffness: float | None,
) -> None:
    # half as long it is strained by 3 %
    wire = Cable.preset("white-wire", length=5.0, axial_stiffness=stiffness)
    hanging = Scene(cable=wire, shape=Straight(direction=(0.0, 0.0, -1.0)), grasps=[HOLD], horizon=1.0)
    assert any("strains the cable by up to 3%" in note for note in predict(hanging).notes) == (stiffness is None)


@pytest.mark.parametrize(("length", "told"), [(1000.0, True), (10.0, False)])
def test_an_error_that_is_much_of_a_small_motion_is_told_of(length: float, told: bool) -> None:
    # the end of a rope is lifted by a metre: 0.2 % of a kilometre are two
    rope = Cable(length=length, diameter=0.03, linear_density=1.0, bending_stiffness=1.0)
    lift = Grasp(u=0.0, path=Move(displacement=(0.0, 0.0, 1.0), duration=1.0))
    found = predict(Scene(cable=rope, shape=Straight(), grasps=[lift], environment=Environment(table=Table())))
    assert found.status == "converged"
    assert any("the cable moves by only 1000 mm, and the estimated error is large" in n for n in found.notes) == told


def test_an_error_is_not_much_of_a_motion_where_nothing_moves() -> None:
    """A cable that hangs from a clamp at rest stays there but for what a solve leaves."""
    clamped = Grasp(u=0.0, hold="clamp")
    found = predict(Scene(cable=cable(), shape=Straight(settle=True), grasps=[clamped], horizon=1.0))
    assert found.status == "converged"
    assert found.accuracy.error_estimate is not None
    assert found.accuracy.error_estimate > 1e-4  # of where it hangs, which two grids tell differently
    assert found.notes == ()


def led(times: Floats, x: Floats) -> Scene:
    """Return a scene whose gripper goes through places along x [m] from where it closes."""
    path = Waypoints(times=times, positions=np.outer(x, [1.0, 0.0, 0.0]))
    return Scene(cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0, path=path)])


def test_a_path_that_swings_far_out_of_its_waypoints_is_told_of_with_how_far_and_when() -> None:
    """Half a second between waypoints, and then 5 ms: between 0 and 30 mm the gripper goes to 0.2 m."""
    times, x = np.array([0.0, 0.47, 0.94, 0.945, 1.4]), np.array([0.0, 0.02, 0.0, 0.01, 0.03])
    hasty = led(times, x)
    (note,) = scene_notes(hasty)
    t = np.linspace(0.0, 1.4, 20001)
    path = hasty.grasps[0].path.at(t, np.zeros(3))[:, 0]
    out = np.maximum(-path, path - 0.03)
    assert note.startswith("the path of primitives[0] swings out of its waypoints by up to ")
    told, when = float(note.split("up to ")[1].split(" mm")[0]), float(note.split("at ")[1].split(" s")[0])
    assert told == pytest.approx(1e3 * out.max(), rel=0.02)
    assert when == pytest.approx(t[out.argmax()], abs=0.06)
    assert not scene_notes(led(np.linspace(0.0, 1.4, 5), x))  # in even times it goes smoothly


def test_a_path_that_swings_a_little_past_where_it_stops_is_not_told_of() -> None:
    """It stands for a second after 0.2 m, and goes 28 mm past that."""
    stops = led(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 0.2, 0.2, 0.2]))
    path = stops.grasps[0].path.at(np.linspace(0.0, 3.0, 301), np.zeros(3))[:, 0]
    assert path.max() == pytest.approx(0.228, abs=1e-3)
    assert scene_notes(stops) == []


def test_noise_of_a_recorded_path_is_no_swing_out_of_it() -> None:
    random = np.random.default_rng(3)
    t = np.linspace(0.0, 2.0, 200)
    x = 0.1 * np.sin(t) + 5e-4 * random.normal(size=t.size)
    x[0] = 0.0
    assert not scene_notes(led(t, x))
    assert not scene_notes(led(t, 1e-4 * random.normal(size=t.size) * (t > 0)))  # held still

"""Derivatives of a prediction: those of closed forms, and those of marches whose tolerance is far below the change."""

from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import (
    Box,
    Cable,
    Capsule,
    ControlPoints,
    Cylinder,
    Environment,
    Grasp,
    Load,
    Material,
    Move,
    Points,
    Quality,
    Scene,
    SceneError,
    Sphere,
    Straight,
    Table,
    Waypoints,
    predict,
    sensitivity,
)
from dlocore.problem.problem import pose
from dlocore.sensitivity import LEAST, STEP, _number, _scale, _with, beside, factored, sensitivities
from dlocore.solvers import march as marching
from dlocore.solvers.monitor import Monitor
from dlocore.spline import greville, uniform_knots
from dlocore.statics.statics import start_grid

U, T = np.linspace(0.05, 0.95, 7), np.linspace(0.2, 1.5, 6)


def scene(**changes: Any) -> Scene:
    values: dict[str, Any] = {
        "cable": Cable.preset("paper", bending_damping=2e-4, axial_stiffness=640.0, torsional_stiffness=1e-3),
        "shape": Straight(start=(0, 0, 0), direction=(1, 0, 0)),
        "grasps": (Grasp(u=0.3, path=Move(displacement=(0.0, 0.4, 0.0), duration=1.5)),),
        "environment": Environment(gravity=(0, 0, 0), drag=0.1, drag_quadratic=0.05),
        "horizon": 1.7,
        "quality": Quality(n_u=11, n_t=15, method="march", estimate=False),
    }
    return Scene(**(values | changes))


NAMES = (
    "cable.bending_stiffness",
    "cable.bending_damping",
    "cable.linear_density",
    "environment.drag",
    "environment.drag_quadratic",
    "grasps[0].u",
    "grasps[0].path.displacement[1]",
    "grasps[0].path.duration",
)


@pytest.fixture(scope="module")
def found() -> np.ndarray:
    sensed = sensitivities(predict(scene()), NAMES)
    assert sensed.exact == (True,) * len(NAMES), sensed.reason
    return sensed(U, T)


def test_the_gripper_moves_with_its_displacement() -> None:
    sensed = sensitivities(predict(scene()), ["grasps[0].path.displacement[1]"])
    x = T / 1.5
    expected = x**3 * (10 - 15 * x + 6 * x**2)  # minimum jerk; the time spline of 15 control points misses 1e-3 of it
    np.testing.assert_allclose(sensed([0.3], T)[0, :, 0, 1], expected, atol=2e-3)


def by_differences(scene: Scene, name: str) -> np.ndarray:
    """Return the derivative by differences of marches over 1e-3 of the value, right to about its square."""
    value = _number(scene, name)
    width = 10 * STEP * value
    ends = [predict(_with(scene, name, value + sign * width)).surface(U, T)[..., :3] for sign in (1.0, -1.0)]
    return np.asarray((ends[0] - ends[1]) / (2.0 * width))


@pytest.mark.parametrize("index", range(len(NAMES)), ids=NAMES)
def test_derivatives_are_those_of_marches_solved_to_rounding(
    index: int, found: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a Newton tolerance so far below the change that the difference of marches is a derivative
    monkeypatch.setattr(marching, "TOLERANCE", 1e-13)
    difference = by_differences(scene(), NAMES[index])
    scale = np.abs(difference).max()  # the largest derivative
    np.testing.assert_allclose(found[index], difference, atol=2e-5 * scale)


def test_where_a_step_is_singular_whole_marches_are_compared(
    found: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sensitivity, "factor_steps", lambda *_: -1)
    sensed = sensitivities(predict(scene()), ["environment.drag"])
    assert sensed.reason == ("the tangent of a step is singular",)
    known = found[NAMES.index("environment.drag")]
    np.testing.assert_allclose(sensed(U, T)[0], known, atol=1e-3 * np.abs(known).max())


@pytest.mark.parametrize("name", ["cable.axial_damping", "cable.axial_stiffness", "grasps[0].path.displacement[1]"])
def test_derivatives_after_a_jump_are_those_of_marches_with_the_same_first_step(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # soft, so that its damping matters, and jerked, so that the first step is one by backward Euler
    jerk = Move(displacement=(0.3, 0.4, 0.0), duration=1.0, profile="linear")
    cable = Cable.preset("paper", axial_stiffness=20.0, axial_damping=2.0)
    jerked = scene(cable=cable, grasps=(Grasp(u=1.0, path=jerk),))
    sensed = sensitivities(predict(jerked), [name])
    assert sensed.exact == (True,), sensed.reason
    monkeypatch.setattr(marching, "TOLERANCE", 1e-13)
    difference = by_differences(jerked, name)
    # a change of the damping by 1e-3 moves it by 1e-6 m, of which rounding and tolerances of 1e-10 m are 1e-4
    np.testing.assert_allclose(sensed(U, T)[0], difference, atol=1e-3 * np.abs(difference).max())


@pytest.mark.parametrize("index", [45, 67, 259], ids=["twist", "a second grasp", "springs away"])
def test_the_motion_beside_is_the_march_where_nothing_is_changed(index: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # it began with an acceleration that does not last for a step, and was up to 0.04 % of the length beside the march
    monkeypatch.setattr(marching, "TOLERANCE", 1e-13)
    problem = pose(draw(128, index, small=True).make())
    grid = start_grid(problem, 16, Monitor())
    motion = marching.march(problem, grid, 70, Monitor())
    states, times, velocity = beside(factored(problem, motion), problem, grid)
    np.testing.assert_allclose(states, motion.states, atol=1e-7 * problem.scene.cable.length)
    np.testing.assert_array_equal(times, motion.times)
    np.testing.assert_allclose(velocity, motion.velocity, atol=1e-7 * problem.scene.cable.length)


@pytest.mark.parametrize(
    ("seed", "index"),
    [(129, 112), (129, 119), (129, 28), (130, 224)],
    ids=["watched at more points", "time knots moved", "and two events", "twist called for"],
)
def test_the_motion_between_both_is_the_predicted_one(seed: int, index: int) -> None:
    # it was one on the grid as it would have been at first: up to 0.2 m beside, and derivatives as wrong
    found = predict(draw(seed, index, small=True).make(), keep_grid=True)
    assert found.status == "converged"
    length = found.scene.cable.length
    sensed = sensitivities(found, ["cable.linear_density"])
    assert sensed.exact == (True,), sensed.reason
    u, t = np.linspace(0.0, length, 9), np.linspace(0.0, found.surface.horizon, 9)
    middle = 0.5 * (sensed.above[0].positions(u, t) + sensed.below[0].positions(u, t))
    np.testing.assert_allclose(middle, found.surface.positions(u, t), atol=1e-5 * length)


def test_contact_is_differentiated_by_whole_marches_and_said_so() -> None:
    ball = Sphere(center=(0.6, 0.1, 0.0), radius=0.05)
    touched = scene(environment=Environment(gravity=(0, 0, 0), drag=0.1, obstacles=(ball,)))
    sensed = sensitivities(predict(touched), ["grasps[0].path.displacement[1]"])
    assert sensed.exact == (False,)
    assert "contact" in sensed.reason[0]
    assert np.isfinite(sensed(U, T)).all()


def test_why_a_derivative_is_not_exact_is_said_of_each_parameter() -> None:
    """The reason of the last that was not exact had been told of all."""
    ball = Sphere(center=(0.6, 0.1, 0.0), radius=0.05)
    held = scene(grasps=(Grasp(u=0.0, hold="tangent", path=Move(displacement=(0.0, 0.1, 0.0), duration=1.5)),))
    touched = replace(held, environment=Environment(gravity=(0, 0, 0), drag=0.1, obstacles=(ball,)))
    at_end = "a place at an end has other knots than one near the end"
    names = ["grasps[0].u", "environment.drag"]
    assert sensitivities(predict(held), names).reason == (at_end, "")
    first, second = sensitivities(predict(touched), names).reason
    assert first == at_end
    assert "contact" in second


def test_contact_that_a_prediction_had_to_make_stiffer_is_as_stiff_beside_it() -> None:
    # a strand that strikes a ball and goes through it on contact as posed: 11 % of the length beside the prediction
    found = predict(draw(130, 63, small=True).make())
    level = found.level
    assert level is not None
    assert level.problem.contact.stiffness > 100.0 * level.posed.contact.stiffness
    sensed = sensitivities(found, ["environment.gravity[2]"])
    length = found.scene.cable.length
    u, t = np.linspace(0.0, length, 9), np.linspace(0.0, found.surface.horizon, 9)
    middle = 0.5 * (sensed.above[0].positions(u, t) + sensed.below[0].positions(u, t))
    np.testing.assert_allclose(middle, found.surface.positions(u, t), atol=5e-3 * length)


@pytest.mark.parametrize(
    ("path", "told"),
    [
        ("cable.colour", "cable has length, diameter, "),
        ("grasps[3].u", "grasps has [0] to [0]."),
        ("grasps[0].start", "grasps[0] has u, path, hold, "),
        ("primitives[0].u", "The scene has cable, shape, grasps, "),
        ("cable", "It has length, diameter, "),
        ("cable.rest_shape", "It is 'straight'."),
        ("environment.gravity", "It has [0] to [2]."),
        ("environment.gravity[7]", "environment.gravity has [0] to [2]."),
        ("__class__", "The scene has cable, shape, "),
        ("a b", "Allowed: a path such as"),
    ],
)
def test_a_path_that_leads_to_no_number_is_refused_with_what_there_is(path: str, told: str) -> None:
    allowed = "(the path of a number of the scene|a path such as)"
    with pytest.raises(SceneError, match=rf"wrt: got [^:]*\. Allowed: {allowed}") as refused:
        sensitivities(predict(scene()), [path])
    assert str(refused.value).startswith(f"wrt: got {path}. {told}")


def test_one_path_in_place_of_a_list_of_them_is_refused() -> None:
    with pytest.raises(SceneError, match=r"wrt: got 'cable\.diameter'\. Allowed: a list of paths"):
        sensitivities(predict(scene()), "cable.diameter")


@pytest.mark.parametrize(("name", "scale"), [("environment.drag", 0.05 / 1.7), ("grasps[0].u", 1.0)])
def test_a_number_at_its_bound_is_changed_to_the_other_side(name: str, scale: float) -> None:
    """As a drag of zero, or the grasp at an end: the derivative is that of the motion with a little more of it."""
    bare = scene(
        environment=Environment(gravity=(0, 0, 0)),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.0, 0.4, 0.0), duration=1.5)),),
    )
    sensed = sensitivities(predict(bare), [name])
    assert sensed.exact == (True,)
    assert sensed.steps == pytest.approx((0.5 * STEP * LEAST * scale,))
    start, more, most = (predict(_with(bare, name, k * 1e-3)).surface(U, T)[..., :3] for k in range(3))
    expected = (4.0 * more - 3.0 * start - most) / 2e-3
    assert np.abs(sensed(U, T)[0] - expected).max() < 2e-3 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("hold", "end", "others"),
    [("tangent", 0.0, ()), ("clamp", 1.0, ()), ("tangent", 0.0, (0.05,)), ("point", 0.0, (0.05,))],
    ids=["tangent", "clamp", "tangent beside a load", "point beside a load"],
)
def test_by_the_place_of_a_grasp_at_an_end_it_is_nearly_that_a_little_away_from_it(
    hold: Any, end: float, others: tuple[float, ...]
) -> None:
    """A tip that bent with a held direction, as it had no span of its own, doubled it, and it was called exact."""

    def held(off: float) -> Scene:
        grasp = Grasp(u=abs(end - off), hold=hold, path=Move(displacement=(0.0, 0.1, 0.0), duration=1.5))
        loads = tuple(Load(u=u, force=(0.0, 0.01, 0.0)) for u in others)
        return scene(grasps=(grasp,), loads=loads, quality=Quality(n_u=14, n_t=15, method="march", estimate=False))

    at_end, inside = (sensitivities(predict(held(off)), ["grasps[0].u"]) for off in (0.0, 3e-3))
    assert (at_end.exact, inside.exact) == ((False,), (True,))
    assert "at an end" in at_end.reason[0]
    difference = at_end(U, T) - inside(U, T)
    assert np.linalg.norm(difference) < 0.05 * np.linalg.norm(inside(U, T))


@pytest.mark.parametrize("gap", [1e-3, 2e-3])
def test_by_the_place_of_a_grasp_at_an_end_no_place_beyond_the_next_grasp_is_compared(gap: float) -> None:
    """Places at 0.1 % and 0.2 % of the length lie to both sides of it, or one on it."""

    def pair(u: float) -> Scene:
        path = Move(displacement=(0.0, 0.2, 0.0), duration=1.5)
        return scene(grasps=(Grasp(u=u, path=path), Grasp(u=gap, path=path)))

    at_end, inside = (sensitivities(predict(pair(u)), ["grasps[0].u"]) for u in (0.0, 0.25 * gap))
    assert (at_end.exact, inside.exact) == ((False,), (True,))
    difference = at_end(U, T) - inside(U, T)
    assert np.linalg.norm(difference) < 0.05 * np.linalg.norm(inside(U, T))
    assert at_end.steps == pytest.approx((gap / 8.0,))


def test_a_place_is_changed_by_less_than_what_parts_it_from_the_next() -> None:
    """As by 1 % where whole marches are compared, which would take it past a grasp 2 mm away."""
    near = scene(grasps=(Grasp(u=0.5), Grasp(u=0.502)), loads=(Load(u=0.5, force=(0.0, 0.01, 0.0)),))
    assert sensitivity._changes(near, "grasps[0].u", 5e-3) == pytest.approx((5e-4, -5e-4))
    assert sensitivity._changes(near, "grasps[0].u", 5e-5) == (5e-5, -5e-5)


@pytest.mark.parametrize("name", ["grasps[0].path.displacement[0]", "shape.start[0]", "environment.drag_quadratic"])
def test_a_number_that_is_tiny_by_chance_is_changed_as_zero_is(name: str) -> None:
    """As 0.5 cos(pi/2) is 3e-17, by a share of which nothing moves: derivatives were 0, or rounding."""
    calm = scene(environment=Environment(gravity=(0, 0, 0), drag=0.1))
    sensed = [sensitivities(predict(_with(calm, name, value)), [name]) for value in (0.0, 3e-17, 1e-12)]
    assert [s.exact for s in sensed] == [(True,)] * 3
    zero, *tiny = (s(U, T) for s in sensed)
    assert np.abs(zero).max() > 0.01
    for found in tiny:
        np.testing.assert_allclose(found, zero, atol=1e-6 * np.abs(zero).max())


def test_the_velocity_of_a_motion_that_goes_on_is_changed_by_more_than_rounding() -> None:
    begun = predict(scene())
    on = scene(shape=begun.shape_at(0.8), grasps=(Grasp(u=0.3),))
    names = [f"shape.velocity[8][{axis}]" for axis in (0, 1)]
    slow = sensitivities(predict(_with(on, names[0], 1e-12)), names)
    assert slow.exact == (True, True)
    still = sensitivities(predict(_with(on, names[0], 0.0)), names)
    np.testing.assert_allclose(slow(U, T), still(U, T), atol=1e-6)
    assert np.abs(still(U, T)).max(axis=(1, 2, 3)).min() > 1e-3


def test_each_number_that_may_be_zero_is_changed_and_each_that_may_not_by_a_share_of_itself() -> None:
    """Whatever a scene holds: what has no scale of its own is above 0 by the checks of the scene."""
    length, ball = 2.0, Sphere(center=(9.0, 0.0, 0.0), radius=1e-9)
    stick = Capsule(start=(9.0, 0.0, 0.0), end=(9.0, 0.0, 1.0), radius=1e-9)
    drum = Cylinder(center=(9.0, 0.0, 0.0), radius=1e-9, height=1e-9)
    crate = Box(center=(9.0, 0.0, 0.0), size=(1e-9, 1e-9, 1e-9), orientation=(1.0, 0.0, 0.0, 0.0))
    places = np.linspace(0.0, length, 9)
    remembered = Material(
        director=(0.0, 0.0, 1.0), u=(0.0, length), memory=np.zeros((2, 3)), stretch=(0.0, 0.0), natural=np.zeros((2, 3))
    )
    along = ControlPoints(
        control_points=np.column_stack([places, 0.0 * places, 0.0 * places]), knots=uniform_knots(9, length),
        velocity=np.zeros((9, 4)), material=remembered, strain=np.zeros(9),
    )  # fmt: skip
    turned = np.tile((1.0, 0.0, 0.0, 0.0), (4, 1))
    led = Waypoints(times=(0.0, 0.1, 0.2, 0.3), positions=np.zeros((4, 3)), orientations=turned)
    moved = Move(displacement=(0.0, 0.0, 0.0), duration=0.01, rotation=(0.0, 0.0, 0.0))
    grasps = (
        Grasp(u=0.0, hold="clamp", path=led, grasp_time=0.0, release_time=0.5),
        Grasp(u=length, hold="clamp", path=moved, grasp_time=0.0),
    )
    cable = Cable.preset(
        "paper", length=length, axial_damping=0.0, yield_strain=1e-9, yield_twist=1e-9, yield_stretch=1e-9,
        memory_rate=1e-9, hardening=0.0,
    )  # fmt: skip
    full = Scene(
        cable=cable, shape=along, grasps=grasps, loads=(Load(u=0.0, force=np.zeros((2, 3)), times=(0.0, 1.0)),),
        environment=Environment(gravity=(0, 0, 0), table=Table(), obstacles=(ball, stick, drum, crate)), horizon=1.0,
    )  # fmt: skip

    def numbers(part: Any, path: str) -> list[tuple[str, float]]:
        if is_dataclass(part):
            return [n for f in fields(part) for n in numbers(getattr(part, f.name), f"{path}.{f.name}".lstrip("."))]
        if isinstance(part, tuple | np.ndarray):
            return [n for i, x in enumerate(part) for n in numbers(x, f"{path}[{i}]")]
        return [(path, float(part))] if isinstance(part, float) else []

    found = numbers(full, "")
    assert len(found) > 200
    without = {path for path, _ in found if _scale(full, path) == 0.0}
    assert not [path for path, value in found if value == 0.0 and path in without]
    assert {"cable.bending_stiffness", "cable.diameter", "horizon", "grasps[1].path.duration"} <= without
    assert _scale(full, "shape.control_points[3][3]") == 1.0
    assert _scale(full, "shape.control_points[3][1]") == length
    assert _scale(full, "shape.velocity[3][3]") == 1.0


def test_it_is_read_at_the_very_ends_of_the_cable_and_of_the_motion() -> None:
    """There it was half of one derivative and half of another: 0.5 m per metre of a straight cable before it moves."""
    names, given = ["cable.length", "horizon"], predict(scene())
    sensed = sensitivities(given, names)
    at = ([0.5, 0.99, 1.0], [0.0, 1.5, 1.7])
    found = sensed(*at)
    np.testing.assert_allclose(found[0, 0], 0.0, atol=1e-9)
    for derivative, name, end in zip(found, names, (1.0, 1.7), strict=True):
        longer = predict(_with(scene(), name, end * 1.001)).surface.positions(*at)
        expected = (longer - given.surface.positions(*at)) / (1e-3 * end)
        np.testing.assert_allclose(derivative, expected, atol=0.02)


def test_by_no_parameter_there_are_no_derivatives() -> None:
    assert sensitivities(predict(scene()), [])(U, T).shape == (0, len(T), len(U), 3)


def test_a_number_that_can_not_change_at_all_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensitivity, "STEP", 10.0)
    with pytest.raises(SceneError) as refused:
        sensitivities(predict(scene()), ["grasps[0].u"])  # neither 3.3 m nor -2.7 m of a cable of one metre
    assert (refused.value.field, refused.value.given) == ("wrt", "grasps[0].u")
    assert "Allowed: 0 to the cable's length, 1 [m]. Allowed" in str(refused.value)


def test_by_a_point_that_a_curve_is_fitted_through_it_is_that_of_whole_marches() -> None:
    """Of a change of 0.1 mm the choice of smoothness is most: 0.34 in place of 0.044, and it had been called exact."""
    u = np.linspace(0.0, 1.0, 15)

    def resting(by: float = 0.0) -> Scene:
        points = np.column_stack([u, 0.05 * u**2])
        points[7, 1] += by
        cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=3e-3, rest_shape=points)
        held, quality = Grasp(u=0.0, hold="clamp"), Quality(n_u=17, n_t=25, keep_grid=True)
        around = Environment(gravity=(0, 0, 0), drag=0.05)
        return Scene(cable=cable, shape=Straight(), grasps=(held,), environment=around, horizon=0.6, quality=quality)

    names = ["cable.rest_shape[7][1]", "cable.bending_stiffness"]
    sensed = sensitivities(predict(resting()), names)
    assert sensed.exact == (False, True)
    assert "smoothness" in sensed.reason[0]
    assert sensed.reason[1] == ""
    step = 3e-3
    above, below = (predict(resting(by)).surface([0.3], [0.6])[0, 0, 1] for by in (step, -step))
    assert sensed([0.3], [0.6])[0, 0, 0, 1] == pytest.approx((above - below) / (2.0 * step), rel=1e-4)


@pytest.mark.parametrize("name", ["grasps[1].u", "cable.axial_stiffness"])
def test_a_start_that_settles_nearly_taut_is_differentiated_over_a_small_step(name: str) -> None:
    """It sags as the root of its slack of 0.3 %: over 1 % of the place of a grasp the derivative is 7 % off."""
    u = np.linspace(0.0, 1.0, 101)
    points = np.column_stack([0.997 * u, 0.0 * u, -0.134 * u * (1.0 - u)])
    cable = Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=2e-4, axial_stiffness=4000.0)
    up = Move(displacement=(0.0, 0.0, 0.1), duration=1.0)
    slack = Scene(
        cable=cable, shape=Points(points=points, settle=True), grasps=(Grasp(u=0.0, path=up), Grasp(u=0.97, path=up)),
        environment=Environment(drag=0.5), quality=Quality(n_u=21, n_t=31, keep_grid=True, estimate=False),
    )  # fmt: skip
    sensed = sensitivities(predict(slack), [name])
    assert sensed.exact == (False,)
    assert "0.1 %" in sensed.reason[0]
    value = _number(slack, name)
    assert sensed.steps == pytest.approx((1e-3 * value,))
    width, t = 2e-4 * value, np.linspace(0.0, 1.0, 9)
    above, below = (predict(_with(slack, name, value + by)).surface.positions(u, t) for by in (width, -width))
    difference = (above - below) / (2.0 * width)
    np.testing.assert_allclose(sensed(u, t)[0], difference, atol=0.005 * np.abs(difference).max())


@pytest.mark.parametrize(
    ("name", "why"),
    [("grasps[0].path.displacement[1]", "in another plane"), ("shape.control_points[7][1]", "leaves its plane")],
)
def test_why_a_motion_in_another_plane_is_not_followed_is_said_in_words(name: str, why: str) -> None:
    hung: Any = Straight(direction=(0.0, 0.0, -1.0))
    if name.startswith("shape"):
        places = greville(uniform_knots(11, 1.0))
        hung = ControlPoints(control_points=np.column_stack([0.1 * places**2, 0.0 * places, -places]))
    swings = scene(
        cable=Cable.preset("paper"),
        shape=hung,
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.2, 0.0, 0.0), duration=1.0)),),
        environment=Environment(drag=0.1),
    )
    sensed = sensitivities(predict(swings), [name])
    assert sensed.exact == (False,)
    assert why in sensed.reason[0]


@pytest.mark.parametrize(("u", "t", "field"), [(2.0, 1.0, "u"), (0.5, 9.0, "t"), (-0.1, 1.0, "u"), ("a", 1.0, "u")])
def test_it_is_read_on_the_cable_and_in_the_motion_alone(u: Any, t: float, field: str) -> None:
    sensed = sensitivities(predict(scene()), ["cable.length"])
    with pytest.raises(SceneError, match=f"^{field}: got"):
        sensed([u], [t])


def test_what_is_no_prediction_or_no_path_is_refused_by_name() -> None:
    with pytest.raises(SceneError, match=r"^prediction: got"):
        sensitivities(None, ["cable.length"])  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=r"^wrt\[1\]: got"):
        sensitivities(predict(scene()), ["cable.length", 3])  # type: ignore[list-item]

# ruff: noqa: E501
"""Bad scenes: an error that names the field, in Python."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    ControlPoints,
    DloError,
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
    SplineSurface,
    Straight,
    Table,
    Waypoints,
    continued,
    equilibrium,
    plan,
    predict,
)
from dlocore.problem.problem import Problem, pose
from dlocore.spline import uniform_knots
from tests.solver.scenes import arc, cable

NAN, INF = float("nan"), float("inf")
UP = Move(displacement=(0.0, 0.1, 0.0), duration=1.0)
SIDE = Grasp(u=0.3, path=UP)
SURFACE = SplineSurface(np.zeros((4, 4, 4)), uniform_knots(4, 1.0), uniform_knots(4, 1.0))


def scene(**parts: Any) -> Scene:
    values: dict[str, Any] = {"cable": cable(), "shape": Straight(), "grasps": (SIDE,)}
    return Scene(**(values | parts))


def waypoints(first: tuple[float, float, float]) -> Grasp:
    return Grasp(u=0.3, path=Waypoints(times=[0.0, 1.0], positions=[first, (0.3, 0.1, 0.0)]))


def apart(distance: float) -> tuple[Grasp, Grasp]:
    """Return grasps at 0.2 and 0.8 m that are `distance` apart in the end."""
    return Grasp(u=0.2), Grasp(u=0.8, path=Move(displacement=(distance - 0.6, 0.0, 0.0), duration=1.0))


BAD: list[tuple[str, Callable[[], object]]] = [
    # cable
    ("length", lambda: cable(length=-1.0)),
    ("length", lambda: cable(length=NAN)),
    ("length", lambda: cable(length="1")),
    ("length", lambda: cable(length=True)),
    ("diameter", lambda: cable(diameter=0.0)),
    ("linear_density", lambda: cable(linear_density=INF)),
    ("bending_stiffness", lambda: cable(bending_stiffness=0.0)),
    ("bending_stiffness", lambda: Cable(length=1.0, diameter=0.01, linear_density=0.1)),
    ("axial_stiffness", lambda: cable(axial_stiffness=NAN)),
    ("bending_damping", lambda: cable(bending_damping=-1e-9)),
    ("axial_damping", lambda: cable(axial_damping=-1e-9)),
    ("axial_damping", lambda: cable(axial_damping=np.nan)),
    ("axial_damping", lambda: cable(axial_damping=np.inf)),
    ("torsional_damping", lambda: cable(torsional_damping=-1e-3)),
    ("memory_rate", lambda: cable(yield_strain=0.01)),
    ("yield_strain", lambda: cable(memory_rate=10.0)),
    ("yield_strain", lambda: cable(yield_strain=0.0, memory_rate=10.0)),
    ("yield_twist", lambda: cable(yield_twist=NAN, memory_rate=10.0)),
    ("memory_rate", lambda: cable(yield_stretch=0.01, memory_rate=-1.0)),
    ("hardening", lambda: cable(hardening=1.5)),
    ("rest_shape", lambda: cable(rest_shape="bent")),
    ("rest_shape", lambda: cable(rest_shape=[(0.0, 0.0, 0.0)])),
    ("rest_shape", lambda: cable(rest_shape=[(0.0, 0.0), (0.5, 0.1), (1.0, 0.0)])),
    ("rest_shape", lambda: cable(rest_shape=[(0.3, 0.0, 0.0)] * 5)),
    ("rest_shape[1][0]", lambda: cable(rest_shape=[[0, 0], [NAN, 0], [1, 1], [2, 1]])),
    ("preset", lambda: Cable.preset("rope")),
    ("colour", lambda: Cable.preset("paper", colour="red")),
    # start
    ("direction", lambda: Straight(direction=(0, 0, 0))),
    ("start[2]", lambda: Straight(start=(0, 0, NAN))),
    ("velocity", lambda: Straight(velocity=[[0, 0, 0]] * 3)),
    ("points", lambda: Points(points=[[0, 0, 0]] * 3)),
    ("points", lambda: Points(points=[[0, 0, 0]] * 9)),
    ("points[2][1]", lambda: Points(points=[[0, 0], [1, 0], [2, INF], [3, 0]])),
    ("control_points[1][3]", lambda: ControlPoints(control_points=[[0, 0, 0, 0], [0, 0, 0, NAN], [0, 0, 1, 0], [1, 0, 0, 0]])),
    ("material.director", lambda: Material(director=(0, 0, 2), u=[0, 1], memory=np.zeros((2, 3)))),
    ("material.u", lambda: Material(director=(0, 0, 1), u=[1, 0], memory=np.zeros((2, 3)))),
    ("material.memory", lambda: Material(director=(0, 0, 1), u=[0, 1], memory=np.zeros((3, 3)))),
    ("material.memory[1][2]", lambda: Material(director=(0, 0, 1), u=[0, 1], memory=[[0, 0, 0], [0, 0, INF]])),
    ("knots", lambda: ControlPoints(control_points=np.eye(4, 3), knots=[0, 0, 0, 0, 1, 1, 1, 2])),
    ("shape.knots[-1]", lambda: scene(shape=ControlPoints(control_points=np.outer(np.linspace(0, 1, 4), [1, 0, 0]), knots=[0] * 4 + [2] * 4))),
    ("shape.points", lambda: predict(scene(shape=Points(points=1.5 * arc(1.0, 1.0))))),
    # grasps
    ("primitives[0].u", lambda: scene(grasps=(Grasp(u=1.2, path=UP),))),
    ("u", lambda: Grasp(u=-0.1)),
    ("u", lambda: Grasp(u=NAN)),
    ("hold", lambda: Grasp(u=0.3, hold="glue")),  # type: ignore[arg-type]
    ("path", lambda: Grasp(u=0.3, path="up")),  # type: ignore[arg-type]
    ("path.rotation", lambda: Grasp(u=0.3, path=Move(displacement=(0, 0, 0), duration=1.0, rotation=(0, 0, 1)))),
    ("path.orientations", lambda: Grasp(u=0.3, path=Waypoints(times=[0, 1], positions=np.zeros((2, 3)), orientations=[[1, 0, 0, 0], [0, 1, 0, 0]]))),
    ("release_time", lambda: Grasp(u=0.3, grasp_time=1.0, release_time=0.5)),
    ("grasp_time", lambda: Grasp(u=0.3, grasp_time=-1.0)),
    ("duration", lambda: Move(displacement=(0, 0, 0), duration=0.0)),
    ("displacement[0]", lambda: Move(displacement=(NAN, 0, 0), duration=1.0)),
    ("profile", lambda: Move(displacement=(0, 0, 0), duration=1.0, profile="fast")),  # type: ignore[arg-type]
    ("times[1]", lambda: Waypoints(times=[0.0, 0.0], positions=np.zeros((2, 3)))),
    ("positions", lambda: Waypoints(times=[0.0, 1.0], positions=np.zeros((3, 3)))),
    ("orientations[1]", lambda: Waypoints(times=[0, 1], positions=np.zeros((2, 3)), orientations=[[1, 0, 0, 0], [2, 0, 0, 0]])),
    ("primitives[0].path.positions[0]", lambda: predict(scene(grasps=(waypoints((0.3, 0.05, 0.0)),)))),
    ("primitives", lambda: scene(grasps=[Grasp(u=i / 40, path=UP) for i in range(33)])),
    ("primitives[1].u", lambda: scene(grasps=(SIDE, Grasp(u=0.30001)))),
    ("primitives[1].path", lambda: predict(scene(grasps=apart(0.7)))),
    ("primitives[1].path", lambda: predict(scene(grasps=apart(-0.7)))),
    # loads and surroundings
    ("loads[0].u", lambda: scene(loads=(Load(u=2.0, force=(0, 0, 1)),))),
    ("force[1]", lambda: Load(u=0.1, force=(0, NAN, 0))),
    ("times", lambda: Load(u=0.1, force=[[0, 0, 0]] * 2, times=[1.0, 0.5])),
    ("gravity[2]", lambda: Environment(gravity=(0, 0, NAN))),
    ("gravity", lambda: Environment(gravity=(0, 0, -1e5))),
    ("drag", lambda: Environment(drag=-0.1)),
    ("friction", lambda: Table(friction=-0.3)),
    ("obstacles[0]", lambda: Environment(obstacles=("sphere",))),
    ("obstacles", lambda: Environment(obstacles=[Sphere(center=(0, 0, 0), radius=0.1)] * 101)),
    ("environment.table.height", lambda: predict(scene(shape=Straight(start=(0, 0, -0.1)), environment=Environment(table=Table())))),
    ("primitives[0].path", lambda: predict(scene(grasps=(Grasp(u=0.3, path=Move(displacement=(0, 0, -0.1), duration=1.0)),), environment=Environment(table=Table())))),
    # parts of another type
    ("cable", lambda: scene(cable={"length": 1.0})),
    ("shape", lambda: scene(shape=[[0, 0, 0], [1, 0, 0]])),
    ("environment", lambda: scene(environment=None)),
    ("effects", lambda: scene(effects="auto")),
    ("quality", lambda: scene(quality="auto")),
    ("grasps", lambda: scene(grasps=SIDE)),
    ("grasps", lambda: scene(grasps=None)),
    ("grasps[1]", lambda: scene(grasps=[SIDE, {"u": 0.8}])),
    ("loads", lambda: scene(loads=Load(u=0.1, force=(0, 0, 1)))),
    ("loads[0]", lambda: scene(loads=[{"u": 0.1}])),
    ("table", lambda: Environment(table=True)),  # type: ignore[arg-type]
    ("table", lambda: Environment(table=0.0)),  # type: ignore[arg-type]
    ("obstacles", lambda: Environment(obstacles=Sphere(center=(0, 0, 0), radius=0.1))),  # type: ignore[arg-type]
    ("obstacles", lambda: Environment(obstacles="sphere")),  # type: ignore[arg-type]
    ("settle", lambda: Straight(settle="yes")),  # type: ignore[arg-type]
    ("settle", lambda: Points(points=arc(1.0, 1.0), settle=1)),  # type: ignore[arg-type]
    ("material", lambda: ControlPoints(control_points=np.eye(4, 3), material={})),  # type: ignore[arg-type]
    ("estimate", lambda: Quality(estimate="no")),  # type: ignore[arg-type]
    ("keep_grid", lambda: Quality(n_u=9, n_t=13, keep_grid=None)),  # type: ignore[arg-type]
    ("scene", lambda: predict({"cable": {}})),  # type: ignore[arg-type]
    ("scene", lambda: plan(None)),  # type: ignore[arg-type]
    ("scene", lambda: equilibrium(Straight())),  # type: ignore[arg-type]
    ("like", lambda: predict(scene(), like=scene())),  # type: ignore[arg-type]
    ("keep_grid", lambda: predict(scene(), keep_grid="no")),  # type: ignore[arg-type]
    ("deadline", lambda: predict(scene(), deadline="5")),  # type: ignore[arg-type]
    ("deadline", lambda: predict(scene(), deadline=-1.0)),
    ("deadline", lambda: predict(scene(), deadline=NAN)),
    ("deadline", lambda: equilibrium(scene(), deadline=-1.0)),
    # lengths in millimetres
    ("primitives[0].path.displacement", lambda: scene(grasps=(Grasp(u=0.3, path=Move(displacement=(0, 500, 0), duration=1.6)),))),
    ("primitives[1].path.positions", lambda: scene(grasps=(SIDE, Grasp(u=0.8, path=Waypoints(times=[0, 1], positions=[[800, 0, 0], [800, 300, 0]]))))),
    ("quality.target_error", lambda: scene(quality=Quality(target_error=2.0))),
    ("shape.points", lambda: predict(scene(shape=Points(points=1000.0 * arc(1.0, 1.0))))),
    # the whole
    ("horizon", lambda: scene(grasps=())),
    ("horizon", lambda: scene(horizon=0.0)),
    ("horizon", lambda: scene(horizon=NAN)),
    ("effects.stretch", lambda: scene(effects={"stretch": "off"})),
    ("effects", lambda: scene(effects={"magnetism": "on"})),
    ("effects.bend", lambda: scene(effects={"bend": "maybe"})),
    ("cable.rest_shape", lambda: predict(scene(cable=cable(rest_shape=arc(3.0, 2.0))))),  # three times as long
    ("cable.rest_shape", lambda: predict(scene(cable=cable(rest_shape=arc(1.0, 2.0)), effects={"twist": "off"}, grasps=(Grasp(u=0.3, path=Move(displacement=(0, 0.1, 0.1), duration=1.0)),)))),
    ("shape.settle", lambda: predict(scene(shape=Straight(settle=True), grasps=(), horizon=1.0))),
    ("primitives", lambda: equilibrium(scene(grasps=(), horizon=1.0))),
    ("at", lambda: equilibrium(scene(), at=NAN)),
    ("n_u", lambda: equilibrium(scene(), n_u=9.5)),  # type: ignore[arg-type]
    ("n_u", lambda: equilibrium(scene(), n_u="9")),  # type: ignore[arg-type]
    ("n_u", lambda: equilibrium(scene(), n_u=3)),
    ("n_u", lambda: equilibrium(scene(), n_u=10**6)),
    ("u", lambda: equilibrium(scene(grasps=(SIDE,))).positions([0.5, 5.0])),
    ("cost", lambda: predict(scene(), cost=3)),  # type: ignore[arg-type]
    ("surface", lambda: continued(None, None)),  # type: ignore[arg-type]
    ("material", lambda: continued(SURFACE, {})),  # type: ignore[arg-type]
    ("stretch", lambda: continued(SURFACE, None, stretch={})),  # type: ignore[arg-type]
    ("t", lambda: continued(SURFACE, None, -1.0)),
    ("preset", lambda: Cable.preset(["paper"])),  # type: ignore[arg-type]
    # quality
    ("n_u", lambda: Quality(n_u=4, n_t=13)),
    ("n_u", lambda: Quality(n_u=9.0, n_t=13)),  # type: ignore[arg-type]
    ("n_t", lambda: Quality(n_u=9, n_t=514)),
    ("n_t", lambda: Quality(n_u=9)),
    ("delta", lambda: Quality(n_u=9, n_t=13, delta=0.0)),
    ("delta", lambda: Quality(delta=1e-5)),
    ("estimate", lambda: Quality(target_error=1e-3, estimate=False)),
    ("keep_grid", lambda: Quality(time_budget=1.0, keep_grid=True)),
    ("target_error", lambda: Quality(target_error=-1.0)),
    ("time_budget", lambda: Quality(time_budget=NAN)),
    ("time_budget", lambda: Quality(target_error=1e-3, time_budget=1.0)),
    ("method", lambda: Quality(method="spacetime")),
    ("method", lambda: Quality(method="paper")),
    ("method", lambda: Quality(method="magic")),  # type: ignore[arg-type]
    ("quality.n_u", lambda: predict(scene(grasps=[Grasp(u=i / 10, path=UP) for i in range(1, 8)], quality=Quality(n_u=9, n_t=13)))),
    ("quality.n_t", lambda: predict(scene(grasps=[Grasp(u=0.3, path=UP, release_time=0.5), Grasp(u=0.6, grasp_time=0.3)], quality=Quality(n_u=9, n_t=7)))),
]  # fmt: skip


@pytest.mark.parametrize(("field", "make"), BAD, ids=[f"{i}-{field}" for i, (field, _) in enumerate(BAD)])
def test_bad_scene_is_refused_by_the_name_of_its_field(field, make):
    with pytest.raises(SceneError) as caught:
        make()
    error = caught.value
    assert error.field == field
    assert error.allowed
    assert isinstance(error, DloError)
    assert isinstance(error, ValueError)
    assert str(error).startswith(f"{field}: got ")


def test_what_is_as_large_as_in_millimetres_is_told_of_as_such():
    far = Move(displacement=(0.0, 500.0, 0.0), duration=1.6)
    with pytest.raises(
        SceneError, match=r"a distance of 500 m\. .* looks like millimetres\. Allowed: at most 100 \[m\]"
    ):
        scene(grasps=(Grasp(u=0.3, path=far),))
    with pytest.raises(SceneError, match="looks like millimetres"):
        scene(quality=Quality(target_error=2.0))
    with pytest.raises(SceneError, match=r"a curve 1000 m long\. .* looks like millimetres"):
        predict(scene(shape=Points(points=1000.0 * arc(1.0, 1.0))))


def test_of_too_few_control_points_it_is_told_how_many_knots_are_needed():
    grasps = (Grasp(u=0.0, path=UP), Grasp(u=0.3, path=UP), Grasp(u=0.6, hold="tangent", path=UP))
    with pytest.raises(
        SceneError, match=r"need 3 knots inside .*\(two for a grasp that holds a direction\)\. Allowed: at least 7"
    ):
        predict(scene(grasps=grasps, quality=Quality(n_u=5, n_t=13)))


def test_a_short_cable_may_be_carried_through_a_hall():
    carried = Grasp(u=0.0, path=Move(displacement=(40.0, 0.0, 0.0), duration=60.0))
    short = Cable(length=0.1, diameter=0.002, linear_density=0.01, bending_stiffness=1e-4)
    assert Scene(cable=short, shape=Straight(), grasps=(carried,)).horizon == 60.0


@pytest.mark.parametrize(
    ("make", "given"),
    [
        (lambda: cable(length="1"), "length: got '1'. Allowed: a finite number"),
        (lambda: cable(length=np.True_), "length: got True. Allowed: a finite number"),
        (lambda: Straight(start="here"), "start: got 'here'. Allowed: finite numbers"),
        (lambda: scene(quality="auto"), "quality: got 'auto'. Allowed: a Quality."),
        (lambda: scene(grasps="all"), "grasps: got 'all'. Allowed: a list of Grasp."),
    ],
)
def test_text_where_none_is_allowed_is_told_in_quotes(make, given):
    with pytest.raises(SceneError) as caught:
        make()
    assert str(caught.value).startswith(given)


@pytest.mark.parametrize("as_given", [lambda x: x, list, lambda x: (1000 * x).astype(int)])
def test_what_a_masked_array_hides_is_no_number(as_given: Callable[[Any], Any]) -> None:
    points = np.ma.masked_array(arc(1.0, 1.0))
    assert np.array_equal(Points(points=points).points, arc(1.0, 1.0))
    points[7, 1] = np.ma.masked
    with pytest.raises(SceneError, match=r"^points\[7\]\[1\]: got nan\. Allowed: finite numbers, n x 3 \[m\]\."):
        Points(points=as_given(points))


def test_grasps_loads_and_obstacles_may_come_from_any_iterable():
    balls = (Sphere(center=(0.0, 9.0, i), radius=0.1) for i in range(2))
    found = scene(grasps=iter([SIDE]), loads=iter([]), environment=Environment(obstacles=balls))  # type: ignore[arg-type]
    assert (found.grasps, found.loads, len(found.environment.obstacles)) == ((SIDE,), (), 2)


def test_a_scene_keeps_its_effects_whatever_becomes_of_what_was_given():
    given: dict[str, Any] = {"twist": "off"}
    kept = scene(effects=given)
    given["twist"] = "sideways"
    for same in (kept, pickle.loads(pickle.dumps(kept)), replace(kept, horizon=1.0)):
        assert same.effects == {"twist": "off"}


def test_two_grasps_pulled_exactly_taut_are_no_bad_scene():
    prediction = predict(scene(grasps=(Grasp(u=0.2, path=UP), Grasp(u=0.8, path=UP))))
    assert np.isfinite(prediction.surface.control_points).all()


def test_how_far_grasps_are_apart_is_told_by_the_clock_of_each():
    """One closes after a second and moves on, and so does the other by then: they stay apart as they were."""
    late = Waypoints(times=[0.0, 1.0], positions=[(1.0, 0.0, 0.0), (1.4, 0.0, 0.0)], profile="linear")
    places = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.4, 0.0, 0.0)]
    early = Waypoints(times=[0.0, 1.0, 2.0], positions=places, profile="linear")
    grasps = (Grasp(u=1.0, grasp_time=1.0, path=late), Grasp(u=0.0, path=early))
    for given in (grasps, grasps[::-1]):
        assert pose(scene(grasps=given)).horizon == 2.0
    with pytest.raises(SceneError, match=r"primitives\[1\]\.path: got 1\.2 m from primitives\[0\]"):
        pose(scene(grasps=(replace(grasps[0], grasp_time=0.5), grasps[1])))
    smooth = (grasps[0], replace(grasps[1], path=replace(early, profile="spline")))  # slower at first
    for given in (smooth, smooth[::-1]):
        with pytest.raises(SceneError, match="where a smooth path swings out between its waypoints"):
            pose(scene(grasps=given))


@pytest.mark.parametrize("length", [0.05, 1.0])
def test_a_start_is_on_the_table_within_what_is_seen_of_such_a_cable(length: float):
    off = min(0.005, 0.02 * length)
    wire = Cable(length=length, diameter=0.005 * length, linear_density=0.05, bending_stiffness=1e-3)

    def posed(z: float) -> Problem:
        start = Straight(start=(0.0, 0.0, z))
        return pose(Scene(cable=wire, shape=start, environment=Environment(table=Table()), horizon=1.0))

    assert posed(0.9 * off).on_table
    assert posed(-0.9 * off).on_table
    assert not posed(1.1 * off).on_table
    with pytest.raises(SceneError, match="below a cable that lies on the table"):
        posed(-1.1 * off)


def test_a_number_may_be_an_array_of_one_without_dimensions() -> None:
    assert Grasp(u=np.array(0.25)).u == 0.25
    with pytest.raises(SceneError, match="u: got"):
        Grasp(u=np.array([0.25]))
    with pytest.raises(SceneError, match="u: got"):
        Grasp(u=np.array(True))


def test_a_rotation_of_a_point_is_told_which_holds_may_turn() -> None:
    with pytest.raises(SceneError) as refused:
        Grasp(u=0.3, path=Move(displacement=(0, 0, 0), duration=1.0, rotation=(0, 0, 1)))
    assert refused.value.given == 'a rotation with hold "point"'
    assert refused.value.allowed == 'no rotation, or hold "tangent" or "clamp"'

"""What grasps, loads and starts can do, against the independent explicit rod and against laws of their own."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rod import converged
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Waypoints,
    equilibrium,
    predict,
)
from tests.solver.scenes import (
    WEIGHTLESS,
    Floats,
    apart,
    arc,
    cable,
    march,
    paper_scene,
    refined,
    samples,
    without_table,
)

DAMPED = Environment(gravity=(0.0, 0.0, 0.0), drag=0.1)


def to_the_rod(scene: Scene, tolerance: float = 5e-4) -> Floats:
    """Return the distances (33, 101) [m] of the refined march from the converged independent rod."""
    u, t = samples(scene)
    rod = converged(scene, tolerance, times=t)
    assert rod.tolerance_met
    surface = refined(scene, tolerance).surface
    return np.linalg.norm(surface.positions(u, t) - rod.positions, axis=-1)


def handing_over() -> Scene:
    first = Grasp(u=0.3, path=Move(displacement=(0.0, 0.2, 0.0), duration=0.8), release_time=1.0)
    second = Grasp(u=0.7, path=Move(displacement=(0.1, 0.2, 0.0), duration=0.8), grasp_time=0.9)
    # drag calms the cable before the second gripper stops it short
    calm = Environment(gravity=(0.0, 0.0, 0.0), drag=0.3)
    return Scene(cable=cable(), shape=Straight(), grasps=(first, second), environment=calm)


def pushed() -> Scene:
    force = [[0, 0, 0], [0, 0.04, 0], [0, 0, 0], [0, -0.02, 0]]
    loads = (Load(u=0.9, force=force, times=[0.0, 0.3, 0.6, 1.0]), Load(u=0.3, force=(0.01, 0.0, 0.0)))
    return Scene(
        cable=cable(), shape=Straight(), grasps=(Grasp(u=0.0, hold="tangent"),), loads=loads, environment=DAMPED,
        horizon=1.0,
    )  # fmt: skip


def thrown() -> Scene:
    rates = np.column_stack([np.zeros(9), 0.6 * np.linspace(-1, 1, 9) ** 2, 0.3 * np.linspace(-1, 1, 9)])
    return Scene(cable=cable(), shape=Straight(velocity=rates), environment=DAMPED, horizon=0.6)


def damped_inside() -> Scene:
    scene = without_table(paper_scene(0.3))
    return replace(scene, cable=cable(bending_damping=1e-5), environment=WEIGHTLESS)


def turned() -> Scene:
    path = Move(displacement=(0.0, 0.2, 0.1), rotation=(0.0, 0.5, 1.0), duration=1.0)
    grasps = (Grasp(u=0.4, hold="tangent", path=path),)
    return Scene(cable=cable(), shape=Straight(), grasps=grasps, environment=DAMPED)


def in_a_wind() -> Scene:
    scene = without_table(paper_scene(0.5))
    return replace(scene, environment=Environment(gravity=(0.0, 0.0, 0.0), drag_quadratic=0.5))


@pytest.mark.parametrize("scene", [handing_over, pushed, thrown, damped_inside, turned, in_a_wind])
def test_motion_agrees_with_the_independent_rod(scene):
    # both are refined to 0.5 mm
    assert to_the_rod(scene()).max() < 1e-3


def test_a_jump_of_velocity_agrees_with_the_independent_rod():
    path = Move(displacement=(0.0, 0.3, 0.0), duration=1.0, profile="linear")
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.5, path=path),), environment=DAMPED)
    # a jump sends waves of every length along the cable: both converge slowly
    assert to_the_rod(scene, 2e-3).max() < 4e-3


def test_every_gripper_is_followed_while_it_is_closed():
    scene = handing_over()
    surface = refined(scene, 1e-3).surface
    t = np.linspace(0.0, 1.7, 341)
    first, second = (surface.positions(g.u, t)[:, 0] for g in scene.grasps)
    held = t <= 1.0
    path = scene.grasps[0].path.at(t, np.array([0.3, 0.0, 0.0]))
    # a cubic time spline can't be a path of degree five: it follows it well within the asked 1 mm
    np.testing.assert_allclose(first[held], path[held], atol=4e-4)
    late = t >= 0.9
    begun = surface.positions(0.7, 0.9)[0, 0]
    np.testing.assert_allclose(second[late], scene.grasps[1].path.at(t[late] - 0.9, begun), atol=4e-4)


def test_an_open_gripper_gives_no_force():
    prediction = refined(handing_over(), 1e-3)
    first, second = prediction.grasps
    assert not first.reaction[first.times > 1.0 + 1e-9].any()
    assert not second.reaction[second.times < 0.9 - 1e-9].any()
    assert np.abs(first.reaction[first.times < 0.99]).max() > 1e-3


def test_a_cable_grasped_where_it_lies_stays_there():
    grasps = (Grasp(u=0.3, grasp_time=0.2), Grasp(u=0.6, hold="tangent", grasp_time=0.4, release_time=0.7))
    scene = Scene(cable=cable(), shape=Straight(), grasps=grasps, environment=WEIGHTLESS, horizon=1.0)
    u, t = samples(scene)
    prediction = predict(replace(scene, quality=march(13, 25)))
    assert prediction.status == "converged"
    start = np.column_stack([u, 0 * u, 0 * u])
    np.testing.assert_allclose(prediction.surface.positions(u, t), np.tile(start, (33, 1, 1)), atol=5e-5)
    # a hundred Newton tolerances of 3e-7 m


def test_noisy_waypoints_give_the_motion_of_the_smooth_path():
    scene = without_table(paper_scene(0.25))
    times = np.linspace(0.0, 1.6, 33)
    rng = np.random.default_rng(4)
    path = scene.grasps[0].path.at(times, np.array([0.25, 0.0, 0.0]))
    noisy = path + rng.normal(0.0, 2e-4, path.shape) * np.array([1, 1, 0])

    def motion(positions: Floats) -> Scene:
        return replace(scene, grasps=(Grasp(u=0.25, path=Waypoints(times=times, positions=positions)),))

    exact = refined(scene, 5e-4).surface
    assert apart(refined(motion(path), 5e-4).surface, exact).max() < 1e-3  # both refined to 0.5 mm
    # noise of 0.2 mm at 20 Hz, amplified by the free ends
    assert apart(refined(motion(noisy), 5e-4).surface, exact).max() < 5e-3


def test_quasi_static_motion_ends_in_the_equilibrium():
    grasps = (
        Grasp(u=0.0, hold="tangent"),
        Grasp(u=1.0, path=Move(displacement=(-0.2, 0.0, 0.15), duration=5.0)),
    )
    scene = Scene(
        cable=cable(),
        shape=Points(points=arc(1.0, 1.0)[:, [0, 2, 1]]),
        grasps=grasps,
        effects={"inertia": "off"},
        quality=march(17, 33),
    )
    prediction = predict(replace(scene, shape=Points(points=arc(1.0, 1.0)[:, [0, 2, 1]], settle=True)))
    assert prediction.status == "converged"
    u = np.linspace(0.0, 1.0, 51)
    at_rest = equilibrium(scene, at=5.0, n_u=17)
    # the same grid: what is left is the Newton tolerance
    np.testing.assert_allclose(prediction.surface.positions(u, 5.0)[0], at_rest.positions(u), atol=1e-4)
    np.testing.assert_allclose(prediction.grasps[1].reaction[-1], at_rest.reactions[1], atol=1e-3)


def test_a_slow_motion_with_inertia_is_the_quasi_static_one():
    # 60 s for half a metre: accelerations of 1e-3 m/s^2
    grasp = Grasp(u=0.0, hold="tangent", path=Move(displacement=(0.0, 0.1, 0.3), duration=60.0))
    scene = Scene(
        cable=cable(),
        shape=Points(points=arc(1.0, 1.0)[:, [0, 2, 1]], settle=True),
        grasps=(grasp, Grasp(u=1.0)),
        environment=Environment(drag=0.1),
        quality=march(17, 65),
    )
    u = np.linspace(0.0, 1.0, 51)
    moved, still = predict(scene), equilibrium(scene, at=60.0, n_u=17)
    assert moved.status == "converged"
    np.testing.assert_allclose(moved.surface.positions(u, 60.0)[0], still.positions(u), atol=5e-4)


def test_a_settled_cable_hangs_still():
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=1.0))
    shape = Points(points=arc(1.0, 1.2)[:, [0, 2, 1]] * [1, 1, -1], settle=True)
    scene = Scene(cable=cable(), shape=shape, grasps=grasps, horizon=0.5, quality=march(17, 13))
    u, t = samples(scene)
    r = predict(scene).surface.positions(u, t)
    # the relaxation ends 1e-8 m from equilibrium, the Newton iteration of a step 3e-7 m
    np.testing.assert_allclose(r, np.broadcast_to(r[0], r.shape), atol=1e-6)


def hung_from_a_point() -> Scene:
    rope = Cable(length=1.0, diameter=0.012, linear_density=0.8, bending_stiffness=0.04)
    grasps, around = (Grasp(u=0.4),), Environment(drag=2.8)
    return Scene(
        cable=rope, shape=Points(points=arc(1.0, 1.0), settle=True), grasps=grasps, environment=around, horizon=1.0
    )


def spanned_between_two() -> Scene:
    turn = np.linspace(0.0, 3.0 * np.pi, 97)[:, None]
    helix = np.hstack([1.7 * np.cos(turn), 1.7 * np.sin(turn), 0.9 * turn])
    length = float(np.linalg.norm(np.diff(helix, axis=0), axis=1).sum())
    wire = Cable(length=length, diameter=0.0027, linear_density=0.16, bending_stiffness=4.4, torsional_stiffness=0.24)
    grasps = (Grasp(u=0.1 * length), Grasp(u=0.8 * length))
    shape = Points(points=helix, settle=True)
    return Scene(cable=wire, shape=shape, grasps=grasps, environment=WEIGHTLESS, horizon=1.0)


@pytest.mark.parametrize("build", [hung_from_a_point, spanned_between_two])
def test_a_cable_that_may_turn_about_itself_settles_and_stays_at_rest(build):
    scene = replace(build(), effects={"twist": "on"}, quality=march(17, 13))
    r = predict(scene).surface.positions(*samples(scene))
    # a force of 1e-6 of the weight moves it by 5e-6 m in a second
    np.testing.assert_allclose(r, np.broadcast_to(r[0], r.shape), atol=5e-6)


@pytest.mark.parametrize("n_u", [9, 13, 25])
def test_a_cable_whose_start_is_its_natural_shape_stays_at_rest(n_u):
    scene = Scene(
        cable=cable(rest_shape="initial"),
        shape=Points(points=arc(1.0, 2.0)),
        grasps=(Grasp(u=0.3),),
        environment=WEIGHTLESS,
        horizon=1.0,
        quality=march(n_u, 13),
    )
    u, t = samples(scene)
    prediction = predict(scene)
    r = prediction.surface.positions(u, t)
    # what is left is the stretch of the fitted start
    np.testing.assert_allclose(r, np.broadcast_to(r[0], r.shape), atol=1e-6)
    assert prediction.start_energy < 1e-7 * 0.5 * 1e-3 * 2.0**2  # of the energy to straighten it


def test_a_cable_in_its_given_natural_shape_stays_at_rest():
    points = arc(1.0, 2.0)
    for shape in (Points(points=points), Points(points=points @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + [1.0, 2.0, 0.0])):
        scene = Scene(
            cable=cable(rest_shape=points), shape=shape, environment=WEIGHTLESS, horizon=1.0, quality=march(17, 13)
        )
        u, t = samples(scene)
        prediction = predict(scene)
        r = prediction.surface.positions(u, t)
        np.testing.assert_allclose(r, np.broadcast_to(r[0], r.shape), atol=1e-4)
        assert prediction.start_energy < 1e-4 * 0.5 * 1e-3 * 2.0**2  # of the energy to straighten it


def test_a_straightened_cable_returns_to_its_natural_arc():
    scene = Scene(
        cable=cable(rest_shape=arc(1.0, 2.0)),
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=WEIGHTLESS,
        horizon=1.0,
    )
    u = np.linspace(0.0, 1.0, 51)
    np.testing.assert_allclose(equilibrium(scene).positions(u), arc(1.0, 2.0, 51), atol=3e-4)
    assert predict(replace(scene, quality=march(17, 13))).start_energy == pytest.approx(0.5 * 1e-3 * 2.0**2, rel=1e-3)


def test_a_release_keeps_the_velocity():
    # let go while moving: the middle flies on
    grasp = Grasp(u=0.5, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.0), release_time=0.5)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(grasp,), environment=WEIGHTLESS, horizon=1.0)
    surface = refined(scene, 1e-3).surface
    before, after = surface(0.5, [0.499, 0.501], dt=1)[:, 0, :3]
    assert np.linalg.norm(after - before) < 0.1 * np.linalg.norm(before)


def test_the_spline_keeps_to_a_path_up_to_the_release_and_to_another_after_it():
    # what springs away after a release is hard to fit, but not where a gripper is
    move = Move(displacement=(0.1, 0.0, 0.1), duration=1.0)
    grasps = (Grasp(u=0.0, path=move), Grasp(u=1.0, path=move, release_time=0.5))
    scene = Scene(cable=cable(), shape=Points(points=arc(1.0, 2.0)), grasps=grasps, environment=DAMPED, horizon=1.0)
    surface = predict(scene).surface
    for g in grasps:
        t = np.linspace(0.0, g.release_time or 1.0, 101)
        path = g.path.at(t, surface.positions(g.u, 0.0)[0, 0])
        assert np.linalg.norm(surface.positions(g.u, t)[:, 0] - path, axis=1).max() < 1e-6


@pytest.mark.parametrize(
    ("profile", "at"), [pytest.param("cubic", 0.6, id="acceleration"), pytest.param("linear", 0.0, id="velocity")]
)
def test_the_reaction_is_a_force_of_the_motion_also_where_that_jumps(profile, at):
    # rates of strain from the velocities that steps leave in a short tip, or that jump, would damp with a ton
    move = Move(displacement=(0.0, 0.3, 0.0), duration=0.6, profile=profile)
    stiff = cable(linear_density=0.02, bending_stiffness=0.2, bending_damping=0.01)
    grasps = (Grasp(u=0.01, hold="clamp", path=move),)
    found = predict(Scene(cable=stiff, shape=Straight(), grasps=grasps, environment=DAMPED, horizon=1.0))
    grasp = found.grasps[0]
    force = np.linalg.norm(grasp.reaction, axis=1)
    instant = np.flatnonzero(np.abs(grasp.times - at) < 1e-9)
    around = np.abs(grasp.times - at) < 0.1
    around[instant] = False
    assert force[instant].max() < 2.0 * force[around].max()


def test_an_answer_tells_of_strains_that_few_cables_bear():
    def hung(stiffness: float) -> Prediction:
        down = Straight(direction=(0.0, 0.0, -1.0))
        return predict(Scene(cable=cable(axial_stiffness=stiffness), shape=down, grasps=(Grasp(u=0.0),), horizon=2.0))

    # let go with a weight of 0.49 N
    firm, soft, softer = hung(100.0), hung(8.0), hung(2.0)
    assert firm.status == soft.status == "converged"
    assert "strain" not in firm.message
    assert "Note: the motion strains the cable by up to 8% along itself." in soft.message
    assert softer.status == "stalled"
    assert "which no cable can follow" in softer.message


def test_quality_auto_takes_the_march_and_a_given_grid_the_least_squares():
    assert predict(paper_scene(0.0, quality=Quality())).accuracy.method == "march"
    assert predict(paper_scene(0.0)).accuracy.method == "spacetime"


def test_what_is_on_one_side_of_a_clamp_moves_as_if_the_cable_ended_there():
    way = Move(displacement=(0.05, 0.1, 0.15), rotation=(0.3, -0.4, 0.5), duration=0.8)
    end = Move(displacement=(-0.1, 0.05, 0.1), duration=0.6)
    points = arc(1.0, 1.2)
    grasps = (Grasp(u=0.4, hold="clamp", path=way), Grasp(u=1.0, path=end))
    whole = Scene(
        cable=cable(bending_stiffness=5e-3),
        shape=Points(points=points),
        grasps=grasps,
        environment=Environment(drag=0.1),
    )
    answer = refined(whole, 2e-3)
    assert answer.accuracy.dimensions == 3
    for begin, end_u in ((0.0, 0.4), (0.4, 1.0)):
        kept = points[round(40 * begin) : round(40 * end_u) + 1]
        held = tuple(replace(g, u=g.u - begin) for g in grasps if begin <= g.u <= end_u)
        part = replace(
            whole, cable=cable(length=end_u - begin, bending_stiffness=5e-3), shape=Points(points=kept), grasps=held
        )
        alone = refined(replace(part, horizon=0.8), 2e-3)
        u, t = samples(alone.surface)
        off = np.linalg.norm(alone.surface.positions(u, t) - answer.surface.positions(u + begin, t), axis=-1).max()
        assert off <= alone.accuracy.error_estimate + answer.accuracy.error_estimate


@pytest.mark.parametrize("hold", ["point", "tangent", "clamp"])
def test_a_gripper_that_another_takes_over_from_on_its_way_makes_no_difference(hold):
    def moved(share: float) -> Move:
        return Move(displacement=share * np.array([0.1, 0.2, 0.1]), duration=share, profile="linear")

    one = Grasp(u=0.3, hold=hold, path=moved(1.0))
    two = (replace(one, path=moved(0.4), release_time=0.4), replace(one, path=moved(0.6), grasp_time=0.4))
    given = Scene(cable=cable(), shape=Points(points=arc(1.0, 1.0)), grasps=(one,), environment=Environment(drag=0.1))
    a, b = refined(given, 2e-3), refined(replace(given, grasps=two), 2e-3)
    assert apart(a.surface, b.surface).max() <= a.accuracy.error_estimate + b.accuracy.error_estimate
    forces = np.concatenate([g.reaction[g.reaction.any(axis=1)] for g in b.grasps])
    assert np.abs(forces).max() <= 1.2 * np.abs(a.grasps[0].reaction).max()  # nothing is caught with a jolt

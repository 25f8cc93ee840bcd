"""What a prediction must not depend on: the frame, the side, the direction of the cable, the run, the thread."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dlocore import ControlPoints, Environment, Grasp, Load, Move, Points, Quality, Scene, Waypoints, predict
from dlocore.shape.shape import start_curve
from tests.solver.scenes import Floats, G, cable, converged, march, paper_scene, samples

TURN = Rotation.from_rotvec([0.3, -0.7, 1.9]).as_matrix()
MIRROR = np.diag([1.0, -1.0, 1.0])
SHIFT = np.array([3.0, -2.0, 0.5])
METHODS = {
    "march": march(13, 25),
    "spacetime": Quality(n_u=13, n_t=25, delta=1e-5, estimate=False),
    "auto": Quality(target_error=5e-3),
}
ROUNDING = 1e-8  # [m]: of 1e-16, amplified by stiff waves and by iterations; measured up to 2e-10
every_method = pytest.mark.parametrize("method", METHODS)


def bent(climb: float) -> Floats:
    """Return points (41, 3) along an arc, or where it climbs a helix, of length 1."""
    turned = np.linspace(0.0, 1.5, 41)
    radius = np.sqrt(1.0 / 1.5**2 - climb**2)
    return np.column_stack([radius * np.sin(turned), radius * (np.cos(turned) - 1.0), climb * turned])


def scene(frame: Floats = np.eye(3), shift: Floats = np.zeros(3), *, planar: bool, method: str) -> Scene:  # noqa: B008
    """Return a scene of everything, seen in another frame: r -> frame r + shift."""
    out = 0.0 if planar else 1.0
    points = bent(0.2 * out)
    rotation = np.linalg.det(frame) * frame @ [0.2 * out, 0.0, 0.7]  # an axial vector
    lift = Move(displacement=frame @ [0.05, 0.3, 0.1 * out], duration=0.8, rotation=rotation)
    swing = Move(displacement=frame @ [-0.1, 0.2, 0.0], duration=0.6)
    return Scene(
        cable=cable(bending_damping=0.0 if method == "spacetime" else 1e-4),
        shape=Points(points=points @ frame.T + shift),
        grasps=(Grasp(u=0.25, hold="tangent", path=lift), Grasp(u=0.9, path=swing, release_time=0.6)),
        loads=(Load(u=0.6, force=frame @ [0.0, 0.02, 0.01 * out]),),
        environment=Environment(gravity=frame @ [0.0, -3.0, out], drag=0.1, drag_quadratic=0.1),
        quality=METHODS[method],
    )


def reversed_direction(forward: Scene) -> Scene:
    """Return the same scene with u counted from the other end."""
    shape = forward.shape
    assert isinstance(shape, Points)
    return replace(
        forward,
        shape=Points(points=np.asarray(shape.points)[::-1]),
        grasps=tuple(replace(g, u=1.0 - g.u) for g in forward.grasps),
        loads=tuple(replace(load, u=1.0 - load.u) for load in forward.loads),
    )


@every_method
@pytest.mark.parametrize("planar", [True, False], ids=["plane", "space"])
@pytest.mark.parametrize(("frame", "shift"), [(TURN, SHIFT), (MIRROR, np.zeros(3))], ids=["rigid motion", "mirror"])
def test_prediction_moves_with_the_scene(frame, shift, planar, method):
    a, b = predict(scene(planar=planar, method=method)), predict(scene(frame, shift, planar=planar, method=method))
    assert a.status == b.status == "converged", (a.message, b.message)
    assert a.accuracy.dimensions == (2 if planar else 3)
    assert b.accuracy.dimensions == (2 if planar else 3)
    u, t = samples(a.surface)
    moved = a.surface.positions(u, t) @ frame.T + shift
    np.testing.assert_allclose(b.surface.positions(u, t), moved, atol=ROUNDING)
    for g, h in zip(a.grasps, b.grasps, strict=True):
        np.testing.assert_allclose(h.reaction, g.reaction @ frame.T, atol=1e-6 * np.abs(g.reaction).max())
        np.testing.assert_allclose(
            h.moment, np.linalg.det(frame) * g.moment @ frame.T, atol=1e-6 * max(np.abs(g.moment).max(), 1e-6)
        )


@every_method
@pytest.mark.parametrize("planar", [True, False], ids=["plane", "space"])
def test_prediction_does_not_depend_on_the_direction_of_the_cable(planar, method):
    forward = scene(planar=planar, method=method)
    a, b = predict(forward), predict(reversed_direction(forward))
    u, t = samples(a.surface)
    np.testing.assert_allclose(b.surface.positions(1.0 - u, t), a.surface.positions(u, t), atol=ROUNDING)


@every_method
def test_prediction_does_not_depend_on_the_order_of_the_grasps(method):
    given = scene(planar=False, method=method)
    a, b = predict(given), predict(replace(given, grasps=given.grasps[::-1]))
    u, t = samples(a.surface)
    np.testing.assert_allclose(b.surface.positions(u, t), a.surface.positions(u, t), atol=ROUNDING)
    np.testing.assert_allclose(
        b.grasps[1].reaction, a.grasps[0].reaction, atol=1e-6 * np.abs(a.grasps[0].reaction).max()
    )


def test_a_sidewise_move_of_a_straight_cable_has_no_preferred_side():
    left, right = (
        predict(replace(paper_scene(0.5), grasps=(Grasp(u=0.5, path=Move(displacement=(0, y, 0), duration=1.6)),)))
        for y in (0.5, -0.5)
    )
    u, t = samples(left.surface)
    np.testing.assert_allclose(
        left.surface.positions(u, t) * [1, -1, 1], right.surface.positions(u, t), atol=1e-9
    )  # rounding


@pytest.mark.parametrize("factor", [0.1, 20.0])
def test_prediction_scales_with_the_units_of_length_time_and_mass(factor):
    # length x a, time x sqrt(a), mass x a^3: the same gravity
    a = factor

    def scaled(a: float) -> Scene:
        made = cable(
            length=a, diameter=0.005 * a, linear_density=0.05 * a * a, bending_stiffness=1e-3 * a**5,
            axial_stiffness=640.0 * a**3,
        )  # fmt: skip
        path = Move(displacement=(0.0, 0.3 * a, 0.1 * a), duration=1.0 * np.sqrt(a))
        return Scene(
            cable=made,
            shape=ControlPoints(control_points=np.outer(np.linspace(0, a, 4), [1, 0, 0])),
            grasps=(Grasp(u=0.25 * a, path=path),),
            environment=Environment(drag=0.1 * a**1.5),
            quality=march(13, 25),
        )

    one, other = predict(scaled(1.0)), predict(scaled(a))
    u, t = samples(one.surface)
    np.testing.assert_allclose(
        other.surface.positions(u * a, t * np.sqrt(a)) / a, one.surface.positions(u, t), atol=1e-5
    )  # the Newton tolerance, on the tail that whips


def carried(velocity: Floats, *, planar: bool) -> Scene:
    """Return a cable without drag that two grippers begin to bring together, seen from a frame that drifts."""
    points = bent(0.0 if planar else 0.2)[:, [0, 2, 1]]
    ways = [Move(displacement=way + velocity, duration=1.0, profile="linear") for way in ([0, 0, 0], [-0.1, 0, 0.2])]
    return Scene(
        cable=cable(bending_damping=1e-4),
        shape=Points(points=points, velocity=velocity),
        grasps=(Grasp(u=0.1, path=ways[0]), Grasp(u=0.9, hold="tangent", path=ways[1])),
        quality=METHODS["auto"],
    )


@pytest.mark.parametrize("planar", [True, False], ids=["plane", "space"])
def test_prediction_is_the_same_from_a_frame_that_drifts(planar):
    drift = np.array([0.3, -0.4, 0.2])  # out of the plane of the motion, so that one of the two is solved in space
    a, b = converged(carried(0.0 * drift, planar=planar)), converged(carried(drift, planar=planar))
    assert (a.accuracy.dimensions, b.accuracy.dimensions) == (2 if planar else 3, 3)
    u, t = samples(a.surface)
    seen = b.surface.positions(u, t) - t[:, None, None] * drift
    np.testing.assert_allclose(seen, a.surface.positions(u, t), atol=ROUNDING)
    for g, h in zip(a.grasps, b.grasps, strict=True):
        np.testing.assert_allclose(h.reaction, g.reaction, atol=1e-5 * np.abs(g.reaction).max())


@pytest.mark.parametrize("rise", [(0.0, 0.0, G), (1.0, 2.0, 3.0)], ids=["weightless", "heavier and aslant"])
@pytest.mark.parametrize("planar", [True, False], ids=["plane", "space"])
def test_weight_is_what_a_frame_that_rises_faster_and_faster_feels(planar, rise):
    given = carried(np.zeros(3), planar=planar)
    start, t = start_curve(given.shape, 1.0), np.linspace(0.0, 1.0, 9)

    def risen(rise: Floats) -> Scene:
        ways = [g.path.at(t, start(g.u)[0]) + 0.5 * t[:, None] ** 2 * rise for g in given.grasps]
        paths = [Waypoints(times=t, positions=way, start="moving") for way in ways]
        grasps = tuple(replace(g, path=path) for g, path in zip(given.grasps, paths, strict=True))
        return replace(given, grasps=grasps, environment=Environment(gravity=rise - [0.0, 0.0, G]))

    a, b = converged(risen(np.zeros(3))), converged(risen(np.array(rise)))
    u, times = samples(a.surface)
    seen = b.surface.positions(u, times) - 0.5 * times[:, None, None] ** 2 * np.array(rise)
    off = np.linalg.norm(seen - a.surface.positions(u, times), axis=-1).max()
    assert off <= min(5e-4, a.accuracy.error_estimate + b.accuracy.error_estimate)


@every_method
def test_prediction_is_bit_identical_on_every_run_and_thread(method):
    given = scene(planar=False, method=method)
    first = predict(given)
    results: list[Floats] = []

    def run() -> None:
        results.extend(predict(given).surface.control_points for _ in range(3))

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 12
    for control in [*results, predict(given).surface.control_points]:
        assert np.array_equal(control, first.surface.control_points)

"""Hard start shapes."""

from dataclasses import replace

import numpy as np

from benchmarks.hard import curves
from benchmarks.hard.cases.base import WEIGHTLESS, apart, case, cord, move, samples
from benchmarks.premises import strands_meet
from dlocore import Environment, Grasp, Points, Prediction, Scene, Straight, Table, predict

TABLE = Environment(drag=0.05, table=Table(friction=0.2))


def _asymmetry(p: Prediction) -> float:
    u, t = samples(p)
    r = p.surface.positions(u, t)
    return float(np.abs(r - (np.array([1.0, 0, 0]) + r[:, ::-1] * [-1, 1, 1])).max())


@case("geometry", "the motion is the mirror image of itself about the middle", error=_asymmetry, within=1e-6)
def straight_start() -> Scene:
    """No curvature anywhere: directions of bending, Frenet frames and torsion are undefined."""
    grasp = Grasp(u=0.5, path=move(0, 0.3))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=replace(WEIGHTLESS, drag=0.1))


def _perturbed(size: float) -> Scene:
    points = curves.wave(1.0, 0.0, 1.0, "flat")
    points = points + size * np.random.default_rng(5).normal(size=points.shape)
    path = move(0.1, 0.25, 0.1)
    around = replace(WEIGHTLESS, drag=0.1)
    return Scene(cable=cord(), shape=Points(points=points), grasps=(Grasp(u=0.3, path=path),), environment=around)


def _from_unperturbed(p: Prediction) -> float:
    return apart(p, predict(replace(_perturbed(0.0), quality=p.scene.quality)))


@case("geometry", "that of the straight start without the noise", error=_from_unperturbed, within=1e-5)
def straight_start_with_noise_of_1e_minus_12() -> Scene:
    """Zero curvature perturbed by 1e-12 m in space: torsion and the plane of the bend are noise."""
    return _perturbed(1e-12)


@case("geometry", "all laws")
def three_inflections() -> Scene:
    """Curvature passes through zero at three places, at which a Frenet frame flips."""
    points = curves.wave(1.0, 0.8, 1.5, "flat")
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(-0.1, 0.1, 0.05)))
    cable = cord(rest_shape="initial")
    return Scene(cable=cable, shape=Points(points=points), grasps=grasps, environment=replace(WEIGHTLESS, drag=0.1))


@case("geometry", "all laws")
def hairpin() -> Scene:
    """Two strands 8 cm apart and a half turn between them, opened by pulling one end: the turn runs along the cable."""
    points = curves.hairpin(1.0, 0.08, "flat")
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(0.5, 0.1, time=1.5)))
    return Scene(cable=cord(), shape=Points(points=points), grasps=grasps, environment=TABLE)


@case("geometry", "all laws; the strands cross on the table", premise=strands_meet)
def full_loop_on_a_table() -> Scene:
    """The tangent turns by 2 pi and one strand lies over the other."""
    points = curves.loop(1.0, 0.6, 0.0, "flat")
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(0.1, 0.0)))
    return Scene(cable=cord(), shape=Points(points=points), grasps=grasps, environment=TABLE)


@case("geometry", "a SceneError: two strands can't be in one place", refused="shape")
def strands_in_one_place() -> Scene:
    """A plane loop without weight, whose strands cross at distance zero: contact has no direction there."""
    points = curves.loop(1.0, 0.6, 0.0, "flat")
    grasps = (Grasp(u=0.0, path=move(0.0, -0.2)),)
    return Scene(cable=cord(), shape=Points(points=points), grasps=grasps, environment=replace(WEIGHTLESS, drag=0.1))


def _rounded(p: Prediction) -> float:
    """Return the distance of the start from the polyline of the given points, point by point along both."""
    points = np.asarray(p.scene.shape.points)  # type: ignore[union-attr]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    u = np.linspace(0.0, p.surface.length, 401)
    given = np.column_stack([np.interp(u / p.surface.length * along[-1], along, x) for x in points.T])
    return float(np.linalg.norm(p.surface.positions(u, 0.0)[0] - given, axis=1).max())


@case("geometry", "all laws; the start is rounded within 1 % of the length", error=_rounded, within=1e-2)
def cusp_in_the_points() -> Scene:
    """The given points turn by 150 degrees at one of them: no cable of finite stiffness lies so."""
    points = curves.corner(1.0, 2.6, 0.5, "flat")
    return Scene(
        cable=cord(), shape=Points(points=points), grasps=(Grasp(u=0.0, path=move(0, -0.3)),), environment=TABLE
    )


def _length_error(p: Prediction) -> float:
    u = np.linspace(0.0, p.surface.length, 2001)
    r = p.surface.positions(u, np.linspace(0.0, p.surface.horizon, 9))
    lengths = np.linalg.norm(np.diff(r, axis=1), axis=-1).sum(axis=1)
    return float(np.abs(lengths / p.surface.length - 1.0).max())


def _scaled(factor: float) -> Scene:
    points = factor * curves.arc(1.0, 1.5, "flat")
    grasp = Grasp(u=0.0, path=move(0, 0.3))
    cable = cord(rest_shape="initial")
    return Scene(cable=cable, shape=Points(points=points), grasps=(grasp,), environment=replace(WEIGHTLESS, drag=0.1))


@case("geometry", "the cable keeps its own length at all times", error=_length_error, within=2e-3)
def start_stretched_by_5_per_cent() -> Scene:
    """The points are 5 % longer than the cable: taken as they are they would store 20 J and explode."""
    return _scaled(1.05)


@case("geometry", "the cable keeps its own length at all times", error=_length_error, within=2e-3)
def start_compressed_by_5_per_cent() -> Scene:
    """The points are 5 % shorter than the cable."""
    return _scaled(0.95)


def _repeated(copies: int, apart: float) -> Scene:
    points = np.repeat(curves.arc(1.0, 1.5, "flat"), copies, axis=0)
    points = points + apart * np.random.default_rng(6).normal(size=points.shape) * [1, 1, 0]
    grasp = Grasp(u=0.0, path=move(0, 0.3))
    cable = cord(rest_shape="initial")
    return Scene(cable=cable, shape=Points(points=points), grasps=(grasp,), environment=replace(WEIGHTLESS, drag=0.1))


def _from_single(p: Prediction) -> float:
    return apart(p, predict(replace(_repeated(1, 0.0), quality=p.scene.quality)))


@case("geometry", "that of the points given once", error=_from_single, within=2e-3)
def points_given_three_times() -> Scene:
    """Each point thrice, a nanometre apart: chord lengths of nothing but noise."""
    return _repeated(3, 1e-9)


def _of_length(length: float) -> Scene:
    """Return the same motion at another size, in the units of gravity."""
    a = length
    cable = cord(
        length=a, diameter=0.005 * a, linear_density=0.05, bending_stiffness=1e-3 * a**3, axial_stiffness=640.0 * a
    )
    path = move(0.0, 0.3 * a, 0.1 * a, time=float(np.sqrt(a)))
    around = Environment(drag=0.05 / float(np.sqrt(a)))
    return Scene(cable=cable, shape=Straight(), grasps=(Grasp(u=0.0, path=path),), environment=around)


def _from_one_metre(p: Prediction) -> float:
    a = p.surface.length
    asked = p.scene.quality
    target = None if asked.target_error is None else asked.target_error / a
    delta = None if asked.n_u is None else asked.threshold / a
    plain = predict(replace(_of_length(1.0), quality=replace(asked, target_error=target, delta=delta)))
    u, t = np.linspace(0, 1, 65), np.linspace(0, plain.surface.horizon, 33)
    scaled = p.surface.positions(a * u, np.sqrt(a) * t) / a
    return float(np.linalg.norm(scaled - plain.surface.positions(u, t), axis=-1).max())


@case("geometry", "that of one metre, scaled", error=_from_one_metre, within=1e-5)
def cable_of_5_cm() -> Scene:
    """Every tolerance that is not relative to the cable shows."""
    return _of_length(0.05)


@case("geometry", "that of one metre, scaled", error=_from_one_metre, within=1e-5)
def cable_of_50_m() -> Scene:
    """Every tolerance that is not relative to the cable shows."""
    return _of_length(50.0)

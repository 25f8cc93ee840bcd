"""Images of a scene: turned and shifted, mirrored, with the cable reversed, or in other units."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from dlocore import (
    Box,
    Capsule,
    ControlPoints,
    Cylinder,
    Move,
    PointMass,
    Points,
    Scene,
    Sphere,
    SplineSurface,
    Waypoints,
)
from dlocore.scene.obstacles import Obstacle
from dlocore.scene.paths import Path
from dlocore.scene.scene import Shape
from dlocore.shape.shape import start_curve

Floats = NDArray[np.float64]

_PLACES = 2001  # along a start: the spin of the frame without twist is integrated over them


@dataclass(frozen=True, kw_only=True, eq=False)
class Image:
    """A map r -> length (frame r) + shift, t -> time t, masses times `mass`, and u -> L - u if the cable is reversed.

    Attributes:
        frame: orthogonal (3, 3); a mirror if its determinant is -1.
        shift: (3,), in the new unit of length.
        length, time, mass: one old unit, in new units.
        backwards: whether u counts from the other end.
    """

    frame: Floats
    shift: Floats
    length: float = 1.0
    time: float = 1.0
    mass: float = 1.0
    backwards: bool = False

    def points(self, r: Any) -> Floats:
        return np.asarray(self.length * (np.asarray(r) @ self.frame.T) + self.shift)

    def vectors(self, v: Any, scale: float = 1.0) -> Floats:
        return np.asarray(scale * (np.asarray(v) @ self.frame.T))

    def turns(self, w: Any) -> Floats:
        """Return the images of rotation vectors; a mirror reverses their sense."""
        return np.asarray(np.linalg.det(self.frame) * (np.asarray(w) @ self.frame.T))

    def back(self, surface: SplineSurface, u: Floats, t: Floats, length: float) -> Floats:
        """Return positions (k_t, k_u, 3) of the image's surface, transformed back to the original scene."""
        at = length - u if self.backwards else u
        return np.asarray((surface.positions(self.length * at, self.time * t) - self.shift) @ self.frame / self.length)


def turned(angle: float, shift: Floats) -> Image:
    """Return a rotation about the vertical, which does not affect gravity and tables, and a shift."""
    return tilted([0.0, 0.0, angle], shift)


def tilted(turn: ArrayLike, shift: Floats) -> Image:
    """Return a rotation by a vector (3,) [rad], and a shift; gravity is rotated too, but a table stays level."""
    return Image(frame=Rotation.from_rotvec(turn).as_matrix(), shift=shift)


def mirrored() -> Image:
    return Image(frame=np.diag([1.0, -1.0, 1.0]), shift=np.zeros(3))


def reversed_cable() -> Image:
    return Image(frame=np.eye(3), shift=np.zeros(3), backwards=True)


def other_units(length: float, time: float, mass: float) -> Image:
    return Image(frame=np.eye(3), shift=np.zeros(3), length=length, time=time, mass=mass)


def seen(scene: Scene, image: Image) -> Scene:
    """Return the image of a scene."""
    a, b, c = image.length, image.time, image.mass
    force, L = c * a / b**2, scene.cable.length
    stiffness = force * a * a
    scales = {
        "length": a, "diameter": a, "linear_density": c / a, "bending_stiffness": stiffness, "axial_stiffness": force,
        "torsional_stiffness": stiffness, "bending_damping": stiffness * b, "torsional_damping": stiffness * b,
        "axial_damping": force * b, "memory_rate": 1.0 / b,
    }  # fmt: skip
    cable = {f.name: getattr(scene.cable, f.name) for f in fields(scene.cable)}
    cable |= {name: scale * cable[name] for name, scale in scales.items() if cable[name] is not None}
    if not isinstance(cable["rest_shape"], str):
        cable["rest_shape"] = image.points(cable["rest_shape"])[:: -1 if image.backwards else 1]

    def place(u: float) -> float:
        return a * (L - u if image.backwards else u)

    cable["point_masses"] = tuple(PointMass(u=place(one.u), mass=c * one.mass) for one in cable["point_masses"])

    def when(t: float | None) -> float | None:
        return None if t is None else b * t

    grasps = tuple(
        replace(
            g, u=place(g.u), path=_path(g.path, image), grasp_time=when(g.grasp_time), release_time=when(g.release_time)
        )
        for g in scene.grasps
    )
    loads = tuple(
        replace(
            x,
            u=place(x.u),
            force=image.vectors(x.force, force),
            times=None if x.times is None else b * np.asarray(x.times),
        )
        for x in scene.loads
    )
    around = scene.environment
    table = around.table and replace(around.table, height=a * around.table.height + float(image.shift[2]))
    environment = replace(
        around,
        gravity=image.vectors(around.gravity, a / b**2),
        drag=around.drag * c / (a * b),
        drag_quadratic=around.drag_quadratic * c / a**2,
        table=table,
        obstacles=tuple(_solid(o, image) for o in around.obstacles),
    )
    quality = scene.quality
    if quality.target_error is not None:
        quality = replace(quality, target_error=a * quality.target_error)
    if quality.delta is not None:
        quality = replace(quality, delta=float(np.clip(a * quality.delta, 1e-10, 1e-2)))
    return replace(
        scene,
        cable=type(scene.cable)(**cable),
        shape=_shape(scene.shape, image, L),
        grasps=grasps,
        loads=loads,
        environment=environment,
        horizon=when(scene.horizon),
        quality=quality,
    )


def _shape(shape: Shape, image: Image, length: float) -> Shape:
    if isinstance(shape, ControlPoints):
        return _spline(shape, image, length)
    order = -1 if image.backwards else 1
    velocity = shape.velocity
    if velocity is not None:
        velocity = image.vectors(velocity, image.length / image.time)
        velocity = velocity[::order] if velocity.ndim == 2 else velocity
    if isinstance(shape, Points):
        return replace(shape, points=image.points(shape.points)[::order], velocity=velocity)
    direction = np.asarray(shape.direction) / np.linalg.norm(np.asarray(shape.direction))
    start = np.asarray(shape.start) + (length * direction if image.backwards else 0.0)
    return replace(shape, start=image.points(start), direction=order * image.vectors(direction), velocity=velocity)


def _spline(shape: ControlPoints, image: Image, length: float) -> ControlPoints:
    """Return the image of control points. Angles change their sign in a mirror, and if the cable is reversed."""
    if shape.material is not None:
        raise TypeError("what the sections remember is relative to a director")
    order = -1 if image.backwards else 1
    sign = order * np.linalg.det(image.frame)
    rows, knots, velocity = np.asarray(shape.control_points), shape.knots, shape.velocity
    if knots is not None:
        knots = image.length * (length - np.asarray(knots) if image.backwards else np.asarray(knots))[::order]
    if velocity is not None:
        given = np.atleast_2d(velocity)
        moving = image.vectors(given[:, :3], image.length / image.time)
        if given.shape[1] == 4:
            spin = given[:, 3:] + (_spin_of_frame(shape, length) if image.backwards else 0.0)
            moving = np.column_stack([moving, sign / image.time * spin])
        velocity = moving[::order] if np.ndim(velocity) == 2 else moving[0]
    return replace(
        shape,
        control_points=np.column_stack([image.points(rows[:, :3]), sign * rows[:, 3]])[::order],
        knots=knots,
        velocity=velocity,
        strain=None if shape.strain is None else np.asarray(shape.strain)[::order],
    )


def _spin_of_frame(shape: ControlPoints, length: float) -> float:
    """Return the spin of the frame without twist at the end of a start [rad/s]; at the beginning it has none."""
    curve = start_curve(shape, length)
    assert curve.theta_rate is not None
    u = np.linspace(0.0, length, _PLACES)
    return float(curve.spin_at(u)[-1] - curve.theta_rate(u)[-1, 0])


def _path(path: Path, image: Image) -> Path:
    if isinstance(path, Move):
        return replace(
            path,
            displacement=image.vectors(path.displacement, image.length),
            duration=image.time * path.duration,
            rotation=None if path.rotation is None else image.turns(path.rotation),
        )
    if isinstance(path, Waypoints):
        turns = path.orientations
        if turns is not None:
            w = image.turns(Rotation.from_quat(np.asarray(turns)[:, [1, 2, 3, 0]]).as_rotvec())
            turns = Rotation.from_rotvec(w).as_quat()[:, [3, 0, 1, 2]]
        times = image.time * np.asarray(path.times)
        return Waypoints(times=times, positions=image.points(path.positions), orientations=turns)
    return path


def _solid(solid: Obstacle, image: Image) -> Obstacle:
    a = image.length
    if isinstance(solid, Sphere):
        return replace(solid, center=image.points(solid.center), radius=a * solid.radius)
    if isinstance(solid, Capsule):
        return replace(solid, start=image.points(solid.start), end=image.points(solid.end), radius=a * solid.radius)
    if isinstance(solid, Cylinder):
        return replace(
            solid,
            center=image.points(solid.center),
            axis=image.vectors(solid.axis),
            radius=a * solid.radius,
            height=a * solid.height,
        )
    assert isinstance(solid, Box)
    turn = np.array([1.0, 0, 0, 0]) if solid.orientation is None else np.asarray(solid.orientation)
    axes = Rotation.from_quat(turn[[1, 2, 3, 0]]).as_matrix()
    # a box is its own mirror image: turn its axes, and keep them right-handed
    moved = image.frame @ axes @ np.diag([1.0, 1.0, np.linalg.det(image.frame)])
    orientation = Rotation.from_matrix(moved).as_quat()[[3, 0, 1, 2]]
    return replace(solid, center=image.points(solid.center), size=a * np.asarray(solid.size), orientation=orientation)

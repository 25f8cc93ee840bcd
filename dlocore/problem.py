"""From a scene to the equations of its motion, before any grid: dimensions, effects, features, prescribed motion."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects import laws
from dlocore.effects.bend import Bend
from dlocore.effects.damping import Damping
from dlocore.effects.drag import LinearDrag, QuadraticDrag
from dlocore.effects.gravity import Gravity
from dlocore.effects.inertia import Inertia
from dlocore.effects.stretch import Stretch
from dlocore.errors import SceneError
from dlocore.paths import Move, Waypoints
from dlocore.scene import MAX_PRESCRIBED_STRAIN, Grasp, Scene
from dlocore.shape import StartCurve, start_curve

Floats = NDArray[np.float64]

LEAST_MASS = 1e-9  # of the true one, where inertia is off: it keeps rigid motion determined
FLATNESS = 1e-9  # of the length: a start and a motion this close to a plane are planar
TABLE_TOLERANCE = 0.005  # [m]: points seen this close to the table lie on it
GRASP_TOLERANCE = 0.010  # [m]: of the first waypoint from the cable


@dataclass(frozen=True, eq=False)
class Plane:
    """Coordinates of the solve: x = axes (r - origin).

    Attributes:
        axes: (nc, 3), orthonormal rows; nc = 2 in the plane, 3 in space.
        origin: (3,) [m].
        reason: why the scene is planar or not, in words.
    """

    axes: Floats
    origin: Floats
    reason: str

    @property
    def dimensions(self) -> int:
        """Number of coordinates, 2 or 3."""
        return len(self.axes)

    def points(self, r: Floats) -> Floats:
        """Return plane coordinates (..., nc) of the points r (..., 3) [m]."""
        return (r - self.origin) @ self.axes.T

    def vectors(self, v: Floats) -> Floats:
        """Return components (..., nc) of the vectors v (..., 3)."""
        return v @ self.axes.T

    def world(self, x: Floats) -> Floats:
        """Return the points r (..., 3) [m] of plane coordinates x (..., nc)."""
        return self.origin + x @ self.axes

    def world_vectors(self, x: Floats) -> Floats:
        """Return the vectors (..., 3) of components x (..., nc)."""
        return x @ self.axes


@dataclass(frozen=True, eq=False)
class Problem:
    """The equations of a scene's motion, before any grid.

    Attributes:
        scene: the scene.
        start: start curve [m].
        plane: coordinates of the solve.
        on_table: the cable lies on the table, which carries its weight.
        inertia, drag, gravity, stretch, bend, damping, quadratic_drag: the active effects, None where inactive.
    """

    scene: Scene
    start: StartCurve
    plane: Plane
    on_table: bool
    inertia: Inertia | None
    drag: LinearDrag | None
    gravity: Gravity | None
    stretch: Stretch
    bend: Bend | None
    damping: Damping | None
    quadratic_drag: QuadraticDrag | None

    @property
    def horizon(self) -> float:
        """Predicted time [s]."""
        return cast(float, self.scene.horizon)

    def mass_density(self) -> float:
        """Return the coefficient of the mass matrix [kg/m]; where inertia is off a trace that fixes rigid motion."""
        return LEAST_MASS * self.scene.cable.linear_density if self.inertia is None else self.inertia.density()

    def drag_coefficient(self) -> float:
        """Return the coefficient of the linear drag matrix [N s/m^2]."""
        return 0.0 if self.drag is None else self.drag.coefficient()

    def law_table(self) -> tuple[NDArray[np.int64], Floats]:
        """Return the switches (laws.COUNT,) and parameters (laws.COUNT, laws.PARAMETERS) of the compiled laws."""
        active = np.zeros(laws.COUNT, np.int64)
        parameters = np.zeros((laws.COUNT, laws.PARAMETERS))
        effects = (
            (laws.STRETCH, self.stretch),
            (laws.BEND, self.bend),
            (laws.DAMPING, self.damping),
            (laws.QUADRATIC_DRAG, self.quadratic_drag),
        )
        for row, effect in effects:
            if effect is not None:
                active[row] = 1
                values = effect.parameters()
                parameters[row, : len(values)] = values
        return active, parameters

    def weight(self) -> Floats:
        """Return the weight per unit length in the solve's coordinates (nc,) [N/m]."""
        return np.zeros(self.plane.dimensions) if self.gravity is None else self.plane.vectors(self.gravity.weight())

    def position(self, grasp: Grasp, t: Floats, start: Floats) -> Floats:
        """Return the prescribed positions (k, nc) of `grasp` at times t (k,) [s] of a path begun at `start` (nc,)."""
        world = self.plane.world(start)
        return self.plane.points(grasp.path.at(t - grasp.start, world))

    def direction(self, grasp: Grasp, t: Floats, start: Floats) -> Floats:
        """Return the prescribed unit tangents (k, nc) of `grasp` at times t (k,) [s], from `start` (nc,)."""
        turns = grasp.path.rotation_at(t - grasp.start)
        if turns is None:
            return np.broadcast_to(start, (len(t), self.plane.dimensions))
        return self.plane.vectors(turns @ self.plane.world_vectors(start))


def pose(scene: Scene) -> Problem:
    """Turn a scene into the equations of its motion.

    Raises:
        SceneError: the scene needs what is not modelled yet, or asks what no cable can follow.
    """
    cable, environment, effects = scene.cable, scene.environment, scene.effects
    start = start_curve(scene.shape, cable.length)
    _check_waypoints(scene, start)
    _check_reach(scene, start)
    on_table = environment.table is not None and effects.get("table", "auto") != "off"
    if on_table:
        start = _lay_on_table(scene, start)
    plane = _find_plane(scene, start, on_table)
    bent = not isinstance(cable.rest_shape, str) or (
        cable.rest_shape == "initial" and len(start.control_points) > 4 and not _is_straight(start)
    )
    natural = _natural_points(scene)
    if on_table and natural is not None and not np.ptp(natural[:, 2]) <= TABLE_TOLERANCE:
        reason = "The cable lies on the table"
        raise SceneError("cable.rest_shape", cable.rest_shape, "points in a horizontal plane", reason)
    if plane.dimensions == 3 and bent:
        reason = "A bent rest shape twists a cable that moves in three dimensions, and twist is not modelled yet"
        raise SceneError("cable.rest_shape", cable.rest_shape, '"straight", or a planar scene', reason)

    def active(name: str, present: bool) -> bool:
        return present and effects.get(name, "auto") != "off"

    return Problem(
        scene=scene,
        start=start,
        plane=plane,
        on_table=on_table,
        inertia=Inertia(cable.linear_density) if active("inertia", True) else None,
        drag=LinearDrag(environment.drag) if active("drag", environment.drag > 0) else None,
        gravity=Gravity(cable.linear_density, cast(Floats, environment.gravity))
        if active("gravity", not on_table and bool(np.any(cast(Floats, environment.gravity) != 0)))
        else None,
        stretch=Stretch(cast(float, cable.axial_stiffness)),
        bend=Bend(cast(float, cable.bending_stiffness)) if active("bend", True) else None,
        damping=Damping(cable.bending_damping, cable.length) if active("damping", cable.bending_damping > 0) else None,
        quadratic_drag=QuadraticDrag(environment.drag_quadratic)
        if active("drag", environment.drag_quadratic > 0)
        else None,
    )


def _natural_points(scene: Scene) -> Floats | None:
    """Return the points (n, 3) [m] of a given natural shape, whose plane is that of the cable's bends, or None."""
    rest = scene.cable.rest_shape
    if isinstance(rest, str):
        return None
    points = cast(Floats, rest)
    return np.column_stack([points, np.zeros(len(points))]) if points.shape[1] == 2 else points


def _is_straight(start: StartCurve) -> bool:
    chord = start.control_points - start.control_points[0]
    return float(np.linalg.svd(chord, compute_uv=False)[1]) <= FLATNESS * float(np.abs(chord).max())


def _check_waypoints(scene: Scene, start: StartCurve) -> None:
    for i, grasp in enumerate(scene.grasps):
        if isinstance(grasp.path, Waypoints) and grasp.start == 0.0:
            first = cast(Floats, grasp.path.positions)[0]
            off = float(np.linalg.norm(first - start(grasp.u)[0]))
            if not off <= GRASP_TOLERANCE:
                reason = f"The cable is {off:.3g} m from it at u = {grasp.u:g} m"
                allowed = f"a point within {GRASP_TOLERANCE:g} m of the grasped point"
                raise SceneError(f"primitives[{i}].path.positions[0]", first, allowed, reason)


def _check_reach(scene: Scene, start: StartCurve) -> None:
    """Refuse two grasps that are at some time farther apart than the cable between them."""
    if len(scene.grasps) < 2:
        return
    t = np.linspace(0.0, cast(float, scene.horizon), 257)
    paths = [g.path.at(t - g.start, start(g.u)[0]) for g in scene.grasps]
    for j, b in enumerate(scene.grasps):
        for i, a in enumerate(scene.grasps[:j]):
            together = (t >= max(a.start, b.start)) & (t <= min(a.release_time or np.inf, b.release_time or np.inf))
            late = max(a.start, b.start) > 0 and not all(isinstance(g.path, Waypoints) for g in (a, b) if g.start > 0)
            if late or not together.any():
                continue  # a later grasp begins where the cable is then, which only the solve can tell
            between = abs(b.u - a.u)
            apart = np.where(together, np.linalg.norm(paths[j] - paths[i], axis=1), 0.0)
            k = int(np.argmax(apart))
            if not apart[k] <= between * (1.0 + MAX_PRESCRIBED_STRAIN) + 1e-6:
                raise SceneError(
                    f"primitives[{j}].path",
                    f"{apart[k]:.4g} m from primitives[{i}] at {t[k]:.3g} s",
                    f"at most {between:.4g} m",
                    "No cable can follow: the two grasps are farther apart than the cable between them",
                )


def _lay_on_table(scene: Scene, start: StartCurve) -> StartCurve:
    """Check that the cable lies on the table and moves in its plane; return the start at the table's height."""
    table = scene.environment.table
    assert table is not None
    height = table.height
    allowed = "a cable that lies on it and moves in its plane, or table null"
    reason = "Contact with a table is not modelled yet"

    def refuse(what: str) -> None:
        raise SceneError("environment.table", what, allowed, reason)

    control = start.control_points
    off = float(np.abs(control[:, 2] - height).max())
    if not off <= TABLE_TOLERANCE:
        refuse(f"a start up to {off:.3g} m off its height")
    gravity = cast(Floats, scene.environment.gravity)
    if gravity[0] != 0 or gravity[1] != 0 or gravity[2] > 0:
        refuse(f"gravity {gravity.tolist()}")
    if start.velocity is not None and np.any(np.abs(start.velocity.control_points[:, 2]) > 1e-9):
        refuse("a start velocity off its plane")
    for i, grasp in enumerate(scene.grasps):
        path = grasp.path
        if isinstance(path, Move) and cast(Floats, path.displacement)[2] != 0:
            refuse(f"primitives[{i}].path.displacement[2] = {cast(Floats, path.displacement)[2]:g} m")
        if isinstance(path, Waypoints) and np.ptp(cast(Floats, path.positions)[:, 2]) > 0:
            refuse(f"primitives[{i}].path.positions off its plane")
        turns = path.rotation_at(np.linspace(0, path.duration, 9)) if path.duration else None
        if turns is not None and np.abs(turns[:, 2, :2]).max() > 1e-9:
            refuse(f"primitives[{i}].path turns the cable off its plane")
    for i, load in enumerate(scene.loads):
        if np.any(np.atleast_2d(cast(Floats, load.force))[:, 2] > 0):
            refuse(f"loads[{i}] lifts the cable")
    flat = control.copy()
    flat[:, 2] = height
    return StartCurve(
        knots=start.knots, control_points=flat, velocity=start.velocity, fit_rms=start.fit_rms, fit_max=start.fit_max,
        length_given=start.length_given,
    )  # fmt: skip


def _find_plane(scene: Scene, start: StartCurve, on_table: bool) -> Plane:
    """Decide between two and three coordinates from everything that could move the cable out of a plane."""
    origin = start.control_points[0]
    if on_table:
        return Plane(np.eye(3)[:2], origin, "the cable lies on the table and moves in its plane")
    length = scene.cable.length
    spread = [(start.control_points - origin) / length]
    if start.velocity is not None:
        spread.append(start.velocity.control_points / max(1e-9, np.abs(start.velocity.control_points).max()))
    for grasp in scene.grasps:
        if isinstance(grasp.path, Move):
            spread.append(cast(Floats, grasp.path.displacement)[None] / length)
        if isinstance(grasp.path, Waypoints):
            positions = cast(Floats, grasp.path.positions)
            spread.append((positions - positions[0]) / length)
            spread.append((positions[:1] - start(grasp.u)) / length)
    gravity = cast(Floats, scene.environment.gravity)
    if np.any(gravity != 0) and scene.effects.get("gravity", "auto") != "off":
        spread.append(gravity[None] / np.linalg.norm(gravity))
    for load in scene.loads:
        force = np.atleast_2d(cast(Floats, load.force))
        spread.append(force / max(1e-300, np.abs(force).max()))
    natural = _natural_points(scene)
    if natural is not None:
        spread.append((natural - natural[0]) / length)
    vectors = np.concatenate(spread)
    _, sizes, principal = np.linalg.svd(np.concatenate([vectors, np.zeros((2, 3))]), full_matrices=False)
    collinear = not sizes[1] > FLATNESS * sizes[0]
    normal = _unit_across(principal[0]) if collinear else principal[2]
    off_plane = float(np.abs(vectors @ normal).max())
    if not off_plane <= FLATNESS * max(1.0, np.abs(vectors).max()):
        return Plane(np.eye(3), origin, "start, motion and forces do not lie in one plane")
    flat_turns = True
    for grasp in scene.grasps:
        turns = grasp.path.rotation_at(np.linspace(0, grasp.path.duration, 33)) if grasp.path.duration else None
        if turns is not None and np.abs(turns @ normal - normal).max() > 1e-9:
            flat_turns = False
    if not flat_turns:
        return Plane(np.eye(3), origin, "a grasp turns the cable out of the plane of its motion")
    normal = normal * (1.0 if normal[np.argmax(np.abs(normal))] > 0 else -1.0)
    first = _unit_across(normal)
    second = np.cross(normal, first)
    return Plane(np.array([first, second]), origin, "start, motion and forces lie in one plane")


def _unit_across(normal: Floats) -> Floats:
    """Return a unit vector in the plane of `normal`: the world axis nearest to it, x before y before z."""
    axis = np.eye(3)[int(np.argmin(np.round(np.abs(normal), 9)))]
    across = axis - normal * (axis @ normal)
    return across / np.linalg.norm(across)

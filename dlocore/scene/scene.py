"""The scene: a cable, its start, its grasps and loads, its surroundings, and the requested quality.

Frozen data in SI units; the world frame is right-handed with z up. Everything is validated once, here.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.errors import (
    MILLIMETRES,
    SceneError,
    array,
    choice,
    columns_of,
    flag,
    instance,
    instances,
    number,
    whole,
)
from dlocore.pickling import Checked, Unwritten
from dlocore.scene.cable import MAX_LENGTH, Cable, PointMass
from dlocore.scene.obstacles import Obstacle
from dlocore.scene.paths import Move, Path, Still, Waypoints
from dlocore.scene.points import points_along
from dlocore.words import counted

Floats = NDArray[np.float64]
Hold = Literal["point", "tangent", "clamp"]
Method = Literal["auto", "march", "spacetime", "paper", "reference"]
Switch = Literal["auto", "on", "off"]

EFFECTS = (
    "inertia",
    "drag",
    "damping",
    "gravity",
    "stretch",
    "bend",
    "twist",
    "plasticity",
    "table",
    "friction",
    "obstacles",
    "self_contact",
)
NEEDED = ("stretch",)  # effects that can't be switched off
MAX_GRASPS = 32
MAX_N_U, MAX_N_T = 129, 513  # of a given grid, to limit memory and time
DELTA = 1e-5  # [m]: threshold of a least squares
MAX_OBSTACLES = 100
MAX_CONTROL_POINTS = 2000  # of a start
AUTO_TARGET = 2e-3  # of the length: the error that quality "auto" aims at
MAX_STRAIN = 0.5  # axial, that a start may have
MAX_PRESCRIBED_STRAIN = 0.005  # of the chord between two grasps: no cable of this kind can follow more
FARTHEST, FAR = 100.0, 50.0  # of the length, and [m]: a gripper path longer than both must be in another unit
AT_ONCE = 1e-5  # of the horizon, or of a swing: times closer than this are simultaneous
MIN_GRASP_DISTANCE = 1e-4  # of the length, between two grasps that hold at the same time


@dataclass(frozen=True, kw_only=True, eq=False)
class Straight(Checked):
    """A straight cable from `start` (3,) [m] along `direction` (3,), which need not have unit length.

    Args (of every start shape):
        settle: relax to static equilibrium before t = 0, under the grasps' first poses. A load that jumps at t = 0
            acts with its force before the jump. On a rough surface the cable relaxes to where friction holds it.
        velocity: initial velocity [m/s]: None (rest), (3,) for all points, or (n, 3) at points evenly spaced along
            the cable. For `Points`, (n, 3) at the points themselves. For `ControlPoints`, the control points of the
            velocity, (n, 3), or (n, 4) with the rate of theta [rad/s]; without it the sections do not spin about
            their tangent.
    """

    start: ArrayLike = (0.0, 0.0, 0.0)
    direction: ArrayLike = (1.0, 0.0, 0.0)
    settle: bool = False
    velocity: ArrayLike | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", array("start", self.start, shape=(3,), unit="m"))
        direction = array("direction", self.direction, shape=(3,))
        if not np.linalg.norm(direction) > 1e-12:
            raise SceneError("direction", direction, "a vector that is not zero")
        object.__setattr__(self, "direction", direction)
        flag("settle", self.settle)
        object.__setattr__(self, "velocity", _velocity(self.velocity, None))


@dataclass(frozen=True, kw_only=True, eq=False)
class Points(Checked):
    """Points `points` (n, 2 or 3) [m] in order along the whole cable, as a vision system delivers them.

    4 to 100,000 points. Uneven spacing, noise and repeated points are accepted; 2D points lie at z = 0. `settle` and
    `velocity` are those of `Straight`.
    """

    points: ArrayLike
    settle: bool = False
    velocity: ArrayLike | None = None

    def __post_init__(self) -> None:
        points = points_along("points", self.points)
        object.__setattr__(self, "points", points)
        flag("settle", self.settle)
        object.__setattr__(self, "velocity", _velocity(self.velocity, len(points)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Material(Checked):
    """What the sections of a cable remember: how they are turned, and their permanent strain.

    Args:
        director: unit vector (3,) across the cable at u = 0, fixed in its section where theta is zero.
        u: material coordinates (k,) [m], rising.
        memory: stress-free strain at `u` (k, 3): two curvatures in the sections' frame and the twist rate
            [1/m, 1/m, rad/m] (the paper's eps_0, eq. 9).
        stretch: stress-free axial strain at `u` (k,); None: zero.
        natural: `memory` before anything yielded (k, 3), towards which hardening pulls back; None: zero.
    """

    director: ArrayLike
    u: ArrayLike
    memory: ArrayLike
    stretch: ArrayLike | None = None
    natural: ArrayLike | None = None

    def __post_init__(self) -> None:
        director = array("material.director", self.director, shape=(3,))
        if not abs(float(np.linalg.norm(director)) - 1.0) < 1e-6:
            raise SceneError("material.director", director, "a unit vector")
        u = array("material.u", self.u, shape=(None,), unit="m")
        if not (len(u) >= 2 and (np.diff(u) > 0).all()):
            raise SceneError("material.u", u, "at least two rising coordinates [m]")
        object.__setattr__(self, "director", director)
        object.__setattr__(self, "u", u)
        object.__setattr__(self, "memory", array("material.memory", self.memory, shape=(len(u), 3), unit="1/m"))
        if self.stretch is not None:
            object.__setattr__(self, "stretch", array("material.stretch", self.stretch, shape=(len(u),)))
        if self.natural is not None:
            object.__setattr__(self, "natural", array("material.natural", self.natural, shape=(len(u), 3), unit="1/m"))


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlPoints(Checked):
    """A cubic spline by its control points (n, 3 or 4) [m, m, m, rad], on `knots` (n + 4,) [m] or uniform ones.

    The knots are clamped (four equal at each end) and run from 0 to the cable's length. The fourth column is theta, the
    angle of the sections against a frame without twist (docs/model.md eq. 19). `settle` and `velocity` are those of
    `Straight`.

    The cable lies along the curve of the spline at its own length, however the control points are spaced. Theta and
    velocity stay with the places of the curve. With `strain` or `material` the spline is instead r(u), with u the
    material coordinate.

    `material` is what the sections remember of an earlier motion. `strain` (n,) is the axial strain at the start: at
    the Greville abscissae, the means of each three successive inner knots, and linear between them. With None the
    strain is zero.
    """

    control_points: ArrayLike
    knots: ArrayLike | None = None
    settle: bool = False
    velocity: ArrayLike | None = None
    material: Material | None = None
    strain: ArrayLike | None = None

    def __post_init__(self) -> None:
        columns = 3 if columns_of(self.control_points) == 3 else 4
        points = array("control_points", self.control_points, shape=(None, columns), unit="m")
        if not 4 <= len(points) <= MAX_CONTROL_POINTS:
            raise SceneError("control_points", f"{len(points)} control points", f"4 to {MAX_CONTROL_POINTS}")
        if columns == 3:
            points = np.column_stack([points, np.zeros(len(points))])
            points.setflags(write=False)
        object.__setattr__(self, "control_points", points)
        if self.knots is not None:
            knots = array("knots", self.knots, shape=(len(points) + 4,), unit="m")
            clamped = np.ptp(knots[:4]) == 0 and np.ptp(knots[-4:]) == 0 and knots[0] == 0
            if not (clamped and (np.diff(knots[3:-3]) >= 0).all()):
                raise SceneError("knots", knots, "rising, four equal at each end, from 0 to the cable's length")
            object.__setattr__(self, "knots", knots)
        flag("settle", self.settle)
        instance("material", self.material, Material | None, "a Material, or None")
        columns = 4 if self.velocity is not None and columns_of(self.velocity) == 4 else 3
        object.__setattr__(self, "velocity", _velocity(self.velocity, len(points), columns))
        if self.strain is not None:
            strain = array("strain", self.strain, shape=(len(points),))
            if not np.abs(strain).max() <= MAX_STRAIN:
                raise SceneError("strain", strain, f"-{MAX_STRAIN:g} to {MAX_STRAIN:g}")
            object.__setattr__(self, "strain", strain)


Shape = Straight | Points | ControlPoints


def _velocity(value: ArrayLike | None, count: int | None, columns: int = 3) -> Floats | None:
    if value is None:
        return None
    if columns_of(value) == 0:
        return array("velocity", value, shape=(3,), unit="m/s")
    velocity = array("velocity", value, shape=(count, columns), unit="m/s")
    if len(velocity) < 4:
        raise SceneError("velocity", counted(len(velocity), "row"), "one velocity, or at least 4")
    return velocity


@dataclass(frozen=True, kw_only=True, eq=False)
class Grasp:
    """A gripper that holds the cable at material coordinate `u` [m] and moves it along `path`.

    Args:
        u: material coordinate [m], 0 to the cable's length.
        hold: "point" holds the position, "tangent" also the direction, "clamp" also the roll of the section.
        path: `Still`, `Move` or `Waypoints`; its clock starts at `grasp_time`.
        grasp_time: when the gripper closes [s]; None: it holds from the start. A gripper that would close at the
            horizon or later never holds the cable, and `Prediction.notes` says so.
        release_time: when it opens [s]; None: never.
    """

    u: float
    path: Path = field(default_factory=Still)
    hold: Hold = "point"
    grasp_time: float | None = None
    release_time: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", number("u", self.u, at_least=0.0, at_most=MAX_LENGTH, unit="m"))
        choice("hold", self.hold, get_args(Hold))
        instance("path", self.path, Path, "Still, Move or Waypoints")
        if self.hold == "point" and (self.path.turn is None or any(self.path.turn[6:])):
            name = "path.rotation" if isinstance(self.path, Move) else "path.orientations"
            raise SceneError(name, 'a rotation with hold "point"', 'no rotation, or hold "tangent" or "clamp"')
        for name in ("grasp_time", "release_time"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, number(name, getattr(self, name), at_least=0.0, at_most=1e4, unit="s"))
        if self.release_time is not None and not self.release_time > self.start:
            raise SceneError("release_time", self.release_time, f"after the grasp at {self.start:g} s")

    @property
    def start(self) -> float:
        """Time at which the grasp begins [s]."""
        return self.grasp_time or 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Load(Checked):
    """A known force at material coordinate `u` [m]: `force` (3,) [N], or (k, 3) at `times` (k,) [s].

    The force is linear between the times; before them the first acts, after them the last. Two equal times are a jump:
    the first has the force before it, the second the force after it.
    """

    u: float
    force: ArrayLike
    times: ArrayLike | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", number("u", self.u, at_least=0.0, at_most=MAX_LENGTH, unit="m"))
        if self.times is None:
            object.__setattr__(self, "force", array("force", self.force, shape=(3,), unit="N"))
            return
        times = load_times("times", self.times)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "force", array("force", self.force, shape=(len(times), 3), unit="N"))

    def at(self, t: Floats, end: float = np.inf) -> Floats:
        """Forces at times `t` (k,) [s]; (k, 3) [N]. At a jump: the force after it, or before it for t >= `end` [s]."""
        force = cast(Floats, self.force)
        if self.times is None:
            return np.broadcast_to(force, (len(t), 3))
        times = cast(Floats, self.times)
        after, before = (
            [np.interp(way * t, (way * times)[::way], force[::way, d]) for d in range(3)] for way in (1, -1)
        )
        return np.where(t < end, after, before).T


def load_times(field: str, given: ArrayLike) -> Floats:
    """Return the times (k,) [s] of a load, or raise SceneError unless they rise; two may be equal, for a jump."""
    times = array(field, given, shape=(None,), unit="s")
    if not (len(times) >= 1 and (np.diff(times) >= 0.0).all() and (times[2:] > times[:-2]).all()):
        raise SceneError(field, times, "rising times [s], two equal ones where the force jumps")
    return times


@dataclass(frozen=True, kw_only=True)
class Table:
    """A horizontal table: `height` [m] of the centreline of a cable that lies on it, and Coulomb's mu as `friction`."""

    height: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "height", number("height", self.height, at_least=-1e4, at_most=1e4, unit="m"))
        object.__setattr__(self, "friction", number("friction", self.friction, at_least=0.0, at_most=10.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Environment(Checked):
    """Gravity, drag, table and obstacles.

    Args:
        gravity: (3,) [m/s^2], at most 1000.
        drag: linear drag per unit length [N s/m^2].
        drag_quadratic: quadratic drag per unit length [N s^2/m^3].
        table: a `Table`; None: there is none.
        obstacles: `Sphere`, `Capsule`, `Cylinder` or `Box`, up to 100.
    """

    gravity: ArrayLike = (0.0, 0.0, -9.81)
    drag: float = 0.0
    drag_quadratic: float = 0.0
    table: Table | None = None
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        gravity = array("gravity", self.gravity, shape=(3,), unit="m/s^2")
        if not np.linalg.norm(gravity) <= 1000.0:
            raise SceneError("gravity", gravity, "at most 1000 [m/s^2]")
        object.__setattr__(self, "gravity", gravity)
        object.__setattr__(self, "drag", number("drag", self.drag, at_least=0.0, at_most=1e6, unit="N s/m^2"))
        quadratic = number("drag_quadratic", self.drag_quadratic, at_least=0.0, at_most=1e6, unit="N s^2/m^3")
        object.__setattr__(self, "drag_quadratic", quadratic)
        instance("table", self.table, Table | None, "a Table, or None")
        obstacles = instances("obstacles", self.obstacles, Obstacle, "Sphere, Capsule, Cylinder or Box")
        if len(obstacles) > MAX_OBSTACLES:
            raise SceneError("obstacles", f"{len(obstacles)} obstacles", f"at most {MAX_OBSTACLES}")
        object.__setattr__(self, "obstacles", obstacles)


@dataclass(frozen=True, kw_only=True)
class Quality:
    """The requested accuracy or grid, and the method.

    Give one of these, or nothing:

    - `n_u` and `n_t`: a given grid;
    - `target_error` [m] at the worst point of the surface;
    - `time_budget` [s]: grids are refined as long as it lasts, but the first is always marched to its end.

    With nothing given, 0.2 % of the cable's length is the aim. With nothing or with a time budget, an estimated error
    of up to 1 % counts as converged.

    Args:
        n_u: control points along the cable, 5 to 129.
        n_t: control points in time, 5 to 513. If the estimated error on a given grid exceeds 1 % of the length, or the
            solve does not finish, finer grids are solved. If these reach 1 % they are the answer, and `message` says
            so. That takes as long as a `target_error` of 1 %; if no grid resolves the motion, a minute or more. A
            deadline limits it, and `keep_grid` leaves it out.
        delta: threshold of a least squares on the norm of its control-point update, paper eq. (25) [m], 1e-10 to 1e-2;
            None: 1e-5. Only with a given grid.
        method: "march", "spacetime", "paper", "reference" (docs/reference.md) or "auto". "auto" is `march`, which on
            the same grid is nearer to the motion and takes less time. It is `spacetime` if a grid is given with a
            `delta`, which a march does not use, and the motion is smooth. If `spacetime` does not converge, `march` is
            the last resort, and `message` says so.
        estimate: with a given grid, estimate the error by a second march on another grid. False saves that time; a
            solve that converges is then the answer, however large its error. Only with a given grid.
        keep_grid: keep the answer of the given grid and of a requested least squares, however large its error, and
            whether it converges or not. For those who measure grids and methods. Only with a given grid.
    """

    n_u: int | None = None
    n_t: int | None = None
    delta: float | None = None
    target_error: float | None = None
    time_budget: float | None = None
    method: Method = "auto"
    estimate: bool = True
    keep_grid: bool = False

    def __post_init__(self) -> None:
        for name, most in (("n_u", MAX_N_U), ("n_t", MAX_N_T)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, whole(name, value, at_least=5, at_most=most))
        if self.delta is not None:
            object.__setattr__(self, "delta", number("delta", self.delta, at_least=1e-10, at_most=1e-2, unit="m"))
        choice("method", self.method, get_args(Method))
        flag("estimate", self.estimate)
        flag("keep_grid", self.keep_grid)
        if (self.n_u is None) != (self.n_t is None):
            missing = "n_u" if self.n_u is None else "n_t"
            raise SceneError(missing, None, "both n_u and n_t, or neither", "One of the two is missing")
        if self.target_error is not None:
            object.__setattr__(
                self, "target_error", number("target_error", self.target_error, at_least=1e-6, at_most=10.0, unit="m")
            )
        if self.time_budget is not None:
            object.__setattr__(
                self, "time_budget", number("time_budget", self.time_budget, at_least=1e-4, at_most=3600.0, unit="s")
            )
        given = [n for n in ("n_u", "target_error", "time_budget") if getattr(self, n) is not None]
        if len(given) > 1:
            raise SceneError(
                given[1], getattr(self, given[1]), "only one of n_u with n_t, target_error and time_budget"
            )
        for name, without in (("delta", None), ("estimate", True), ("keep_grid", False)):
            if self.n_u is None and getattr(self, name) != without:
                raise SceneError(name, getattr(self, name), "n_u and n_t given with it")
        if self.method in ("spacetime", "paper") and self.n_u is None:
            raise SceneError("method", self.method, "n_u and n_t given with it")
        if self.method == "reference" and (self.n_u is not None or self.time_budget is not None):
            name = "n_u" if self.n_u is not None else "time_budget"
            raise SceneError(name, getattr(self, name), 'target_error or nothing with method "reference"')

    @property
    def threshold(self) -> float:
        """The threshold of a least squares on its update [m]: `delta`, or DELTA if none is given."""
        return DELTA if self.delta is None else self.delta


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene(Checked):
    """Everything `predict` needs.

    Args:
        cable: the cable.
        shape: where it is at t = 0.
        grasps: the grippers that hold and move it (`primitives` in requests and errors).
        loads: known forces.
        environment: gravity, drag, table, obstacles.
        horizon: predicted time [s]; None: until the last path ends, the last grasp opens and the last load is given.
        effects: "on", "off" or "auto" by effect name; effects not named are "auto".
        quality: the requested accuracy or grid.

    Raises:
        SceneError: a part contradicts another, e.g. a grasp off the cable, or grasps too far apart.
    """

    cable: Cable
    shape: Shape
    grasps: tuple[Grasp, ...] = ()
    loads: tuple[Load, ...] = ()
    environment: Environment = field(default_factory=Environment)
    horizon: float | None = None
    effects: Mapping[str, Switch] = field(default_factory=dict)
    quality: Quality = field(default_factory=Quality)

    def __post_init__(self) -> None:
        instance("cable", self.cable, Cable, "a Cable")
        instance("shape", self.shape, Shape, "Straight, Points or ControlPoints")
        instance("environment", self.environment, Environment, "an Environment")
        instance("effects", self.effects, Mapping, 'a dict of "on", "off" or "auto" by effect name')
        instance("quality", self.quality, Quality, "a Quality")
        object.__setattr__(self, "effects", Unwritten(self.effects))  # a copy: the caller may change the original
        object.__setattr__(self, "grasps", instances("grasps", self.grasps, Grasp, "Grasp"))
        object.__setattr__(self, "loads", instances("loads", self.loads, Load, "Load"))
        length = self.cable.length
        if len(self.grasps) > MAX_GRASPS:
            raise SceneError("primitives", f"{len(self.grasps)} primitives", f"at most {MAX_GRASPS}")
        places = [(f"primitives[{i}].u", g.u) for i, g in enumerate(self.grasps)]
        places += [(f"loads[{i}].u", load.u) for i, load in enumerate(self.loads)]
        for name, u in places:
            if not u <= length:
                raise SceneError(name, u, f"0 to the cable's length, {length:g} [m]")
        self._check_sizes()
        self._check_horizon()
        self._check_effects()
        self._check_overlap()
        if isinstance(self.shape, ControlPoints) and self.shape.knots is not None:
            last = float(cast(Floats, self.shape.knots)[-1])
            if not abs(last - length) <= 1e-9 * length:
                raise SceneError("shape.knots[-1]", last, f"the cable's length, {length:g} [m]")

    def _check_sizes(self) -> None:
        """Refuse lengths so large compared with the cable that they must be in another unit."""
        length, target = self.cable.length, self.quality.target_error
        if target is not None and not target <= length:
            raise SceneError("quality.target_error", target, f"at most the cable's length, {length:g} [m]", MILLIMETRES)
        most = max(FARTHEST * length, FAR)
        for i, grasp in enumerate(self.grasps):
            name, far = _farthest(grasp.path)
            if not far <= most:
                field = f"primitives[{i}].path.{name}"
                raise SceneError(field, f"a distance of {far:g} m", f"at most {most:g} [m] for this cable", MILLIMETRES)

    @property
    def swing(self) -> float:
        """Approximate period of a swing of the cable on Earth [s], whatever the gravity of the scene."""
        return 2.0 * math.sqrt(self.cable.length)

    @property
    def moment(self) -> float:
        """Longest time between two times that count as one [s]: equal times computed as sums differ by rounding."""
        return AT_ONCE * min(cast(float, self.horizon), self.swing)

    @property
    def weight(self) -> float:
        """Weight of the cable and its point masses [N]."""
        gravity = float(np.linalg.norm(cast(Floats, self.environment.gravity)))
        return self.cable.mass * gravity

    @property
    def places(self) -> tuple[float, ...]:
        """Material coordinates of the grasps, loads and point masses [m]."""
        parts: tuple[Grasp | Load | PointMass, ...] = (*self.grasps, *self.loads, *self.cable.point_masses)
        return tuple(part.u for part in parts)

    def _check_horizon(self) -> None:
        if self.horizon is not None:
            object.__setattr__(self, "horizon", number("horizon", self.horizon, above=1e-4, at_most=1e4, unit="s"))
            return
        ends = [g.start + g.path.duration for g in self.grasps]
        ends += [g.release_time for g in self.grasps if g.release_time is not None]
        ends += [float(cast(Floats, load.times)[-1]) for load in self.loads if load.times is not None]
        longest = max(ends, default=0.0)
        if not longest > 1e-4:
            raise SceneError("horizon", None, "a time [s], since no path has a duration", "It is missing")
        object.__setattr__(self, "horizon", longest)

    def _check_effects(self) -> None:
        for name, value in self.effects.items():
            choice("effects", name, EFFECTS)
            choice(f"effects.{name}", value, get_args(Switch))
            if name in NEEDED and value == "off":
                reason = "Without axial stiffness a cable has no length"
                raise SceneError(f"effects.{name}", "off", '"on" or "auto"', reason)

    def _check_overlap(self) -> None:
        for j, b in enumerate(self.grasps):
            for i, a in enumerate(self.grasps[:j]):
                a_end = np.inf if a.release_time is None else a.release_time
                b_end = np.inf if b.release_time is None else b.release_time
                together = min(a_end, b_end) - max(a.start, b.start) > self.moment
                if together and abs(a.u - b.u) < MIN_GRASP_DISTANCE * self.cable.length:
                    nearest = MIN_GRASP_DISTANCE * self.cable.length
                    reason = f"primitives[{i}] holds it at {a.u:g} m at the same time"
                    raise SceneError(f"primitives[{j}].u", b.u, f"at least {nearest:g} m from it", reason)


def _farthest(path: Path) -> tuple[str, float]:
    """Return the name of the field that sets how far a path goes, and its largest distance from its start [m]."""
    if isinstance(path, Move):
        return "displacement", float(np.linalg.norm(cast(Floats, path.displacement)))
    if isinstance(path, Waypoints):
        positions = cast(Floats, path.positions)
        return "positions", float(np.linalg.norm(positions - positions[0], axis=1).max())
    return "", 0.0

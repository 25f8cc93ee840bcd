"""From a scene to the equations of its motion, before any grid: dimensions, effects, features."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects import laws
from dlocore.effects.base import Effect
from dlocore.effects.bend import Bend
from dlocore.effects.contact import DEEPEST, Contact, TableContact
from dlocore.effects.damping import Damping, TwistDamping
from dlocore.effects.drag import LinearDrag, QuadraticDrag
from dlocore.effects.friction import Friction, slip_of
from dlocore.effects.gravity import Gravity
from dlocore.effects.inertia import Inertia
from dlocore.effects.plasticity import BendingMemory, StretchMemory, TwistMemory
from dlocore.effects.selfcontact import SelfContact
from dlocore.effects.stretch import Stretch, StretchDamping
from dlocore.effects.twist import Twist
from dlocore.errors import SceneError, instance
from dlocore.kernels.projection import in_world
from dlocore.problem.brought import brought
from dlocore.problem.buckling import out_of_plane, with_side
from dlocore.problem.checks import check_above, check_apart, check_outside, check_reach
from dlocore.problem.cleared import cleared
from dlocore.problem.events import Event, find_events
from dlocore.problem.features import Features, find_features
from dlocore.problem.plane import Plane, find_plane, is_straight, lay_on_table, off_the_table, rest_plane
from dlocore.problem.selection import Choice, choose, reached
from dlocore.problem.standing import obstacle_rows
from dlocore.scene.obstacles import Box, Cylinder, Obstacle
from dlocore.scene.scene import Scene
from dlocore.shape.shape import StartCurve, start_curve
from dlocore.spline import DEGREE

Floats = NDArray[np.float64]

LEAST_MASS = 1e-9  # of the true mass, if inertia is off: it keeps rigid motion determined
MOST_NODES = 4000  # of contact
_SAG = 0.005  # of the diameter: largest sag of a cable on something round between two contact nodes
_SEGMENTS = 800  # of the cable for its contact with itself, if they are shorter than a diameter
_STIFFENING = 10.0  # largest factor by which contact is stiffened at once
_EDGES = 16.0  # contact nodes per diameter, if obstacles have edges
_ON_TABLE, _OF_SPAN = 64.0, 4.0  # least contact nodes of a table, on the cable and on a span of its spline


@dataclass(frozen=True, eq=False)
class Problem:
    """The equations of a scene's motion, before any grid.

    Attributes:
        scene: the scene.
        start: start curve [m].
        plane: coordinates of the centreline in the solve.
        on_table: whether the cable lies on the table all the time, which carries its weight.
        lies_over: whether it lies on a table, where one strand may lie over another. It may still leave the table when
            its sections turn over.
        choices: for each effect whether it is simulated, and why.
        called_for: the effects that a result has called for, and why. "side" lets the cable leave the plane of the
            motion, by a bow, or the table.
        inertia, drag, gravity, ...: the active effects, None where inactive.
    """

    scene: Scene
    start: StartCurve
    plane: Plane
    on_table: bool
    lies_over: bool
    choices: Mapping[str, Choice]
    called_for: Mapping[str, str]
    inertia: Inertia | None
    drag: LinearDrag | None
    gravity: Gravity | None
    stretch: Stretch
    stretch_damping: StretchDamping | None
    bend: Bend | None
    damping: Damping | None
    quadratic_drag: QuadraticDrag | None
    twist: Twist | None
    twist_damping: TwistDamping | None
    bending_memory: BendingMemory | None
    twist_memory: TwistMemory | None
    stretch_memory: StretchMemory | None
    contact: Contact | None
    table: TableContact | None
    friction: Friction | None
    self_contact: SelfContact | None
    obstacles: tuple[Obstacle, ...]

    @property
    def horizon(self) -> float:
        """Predicted time [s]."""
        return cast(float, self.scene.horizon)

    @property
    def rest_shape(self) -> str | Floats:
        """The stress-free shape: "straight", "initial" or points (n, 3) [m]."""
        rest = self.scene.cable.rest_shape
        return "initial" if self.start.bow and isinstance(rest, str) else cast(str | Floats, rest)

    @property
    def rests_straight(self) -> bool:
        """Whether the stress-free shape is straight."""
        rest = self.rest_shape
        return isinstance(rest, str) and rest == "straight"

    @property
    def rests_as_it_begins(self) -> bool:
        """Whether the scene defines the start as the stress-free shape, so that another start changes that too."""
        rest = self.scene.cable.rest_shape
        return isinstance(rest, str) and rest == "initial"

    @cached_property
    def features(self) -> Features:
        """Where along the cable knots are needed, without sharp bends of the start."""
        return find_features(self.scene)

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """The events inside the horizon, by time."""
        return find_events(self.scene)

    @property
    def touches(self) -> bool:
        """Whether contact, friction or self-contact is simulated: forces with kinks."""
        return self.contact is not None or self.friction is not None or self.self_contact is not None

    @cached_property
    def kinks(self) -> int:
        """Number of inner places where grasps hold directions, so that the angle of the sections may have a kink."""
        if self.twist is None:
            return 0
        u, multiplicity = self.features.u, self.features.multiplicity
        return int(((multiplicity > 1) & (u > 0.0) & (u < self.scene.cable.length)).sum())

    @cached_property
    def rest_plane(self) -> Plane:
        """The plane of start, paths and forces; if the start settles in a plane first, of all but the paths."""
        return rest_plane(self.scene, self.start)

    @property
    def line(self) -> Self:
        """The problem of the centreline alone, without the angle of the sections."""
        return self if self.twist is None else self._untwisted  # caching `self` would be a cycle for the collector

    @cached_property
    def _untwisted(self) -> Self:
        return replace(self, twist=None)

    @cached_property
    def nc(self) -> int:
        """Number of coordinates of a control point: 2 in the plane, 3 in space, 4 with twist."""
        return self.plane.dimensions + (self.twist is not None)

    @cached_property
    def axes(self) -> tuple[int, ...]:
        """(0, 1), (0, 1, 2) or (0, 1, 2, 3): its type tells the compiled kernels the number of coordinates."""
        return tuple(range(self.nc))

    def coordinates(self, r: Floats, theta: Floats | None = None) -> Floats:
        """Return control points (..., nc) in the solve's coordinates of r (..., 3) [m] and theta (...) [rad]."""
        return self._with_twist(self.plane.points(r), theta)

    def rates(self, v: Floats, theta_rate: Floats | None = None) -> Floats:
        """Return velocities (..., nc) in the solve's coordinates of v (..., 3) [m/s] and of theta [rad/s]."""
        return self._with_twist(self.plane.vectors(v), theta_rate)

    def _with_twist(self, x: Floats, theta: Floats | None) -> Floats:
        """Return x (..., 2 or 3), with the angle or its rate as fourth coordinate if there is twist."""
        if self.twist is None:
            return np.ascontiguousarray(x)
        turned = np.zeros(x.shape[:-1]) if theta is None else theta
        return np.concatenate([x, self.twist.radius * turned[..., None]], axis=-1)

    def world(self, q: Floats) -> Floats:
        """Return (x, y, z, theta) (..., 4) [m, m, m, rad] of control points q (..., nc)."""
        radius = 1.0 if self.twist is None else self.twist.radius
        flat = in_world(q.reshape(-1, q.shape[-1]), self.plane.origin, self.plane.axes, radius)
        return np.asarray(flat.reshape((*q.shape[:-1], 4)))

    def mass_density(self) -> float:
        """Return the coefficient of the mass matrix [kg/m]; if inertia is off, a tiny one that fixes rigid motion."""
        return LEAST_MASS * self.scene.cable.linear_density if self.inertia is None else self.inertia.density()

    @cached_property
    def masses(self) -> Floats:
        """Material coordinate of each point mass, and the length of cable of equal mass, (k, 2) [m].

        See docs/model.md eq. 9a.
        """
        cable = self.scene.cable
        return np.array([(one.u, one.mass / cable.linear_density) for one in cable.point_masses]).reshape(-1, 2)

    def drag_coefficient(self) -> float:
        """Return the coefficient of the linear drag matrix [N s/m^2]."""
        return 0.0 if self.drag is None else self.drag.coefficient()

    def law_table(self) -> tuple[NDArray[np.int64], Floats]:
        """Return switches (laws.COUNT,) and parameters (laws.COUNT + obstacles, laws.PARAMETERS) of compiled laws."""
        active, parameters = self.laws
        return active.copy(), parameters.copy()

    @cached_property
    def keeps_history(self) -> bool:
        """Whether a law reads the history of earlier steps."""
        return bool(self.laws[0][list(laws.READ_HISTORY)].any())

    @cached_property
    def keeps_curvature(self) -> bool:
        """Whether a law reads the curvature or the frames of earlier steps."""
        return bool(self.laws[0][list(laws.READ_CURVATURE)].any())

    @cached_property
    def laws(self) -> tuple[NDArray[np.int64], Floats]:
        """The arrays of `law_table`, not copied: read them only."""
        active = np.zeros(laws.COUNT, np.int64)
        parameters = np.zeros((laws.COUNT + len(self.obstacles), laws.PARAMETERS))
        if self.obstacles:
            parameters[laws.COUNT :] = obstacle_rows(self.scene, self.obstacles)
            parameters[laws.COUNT :, 1:4] -= self.plane.origin
        effects: tuple[tuple[int, Effect | None], ...] = (
            (laws.STRETCH, self.stretch),
            (laws.BEND, self.bend),
            (laws.DAMPING, self.damping),
            (laws.QUADRATIC_DRAG, self.quadratic_drag),
            (laws.TWIST, self.twist),
            (laws.TWIST_DAMPING, self.twist_damping),
            (laws.BENDING_MEMORY, self.bending_memory),
            (laws.TWIST_MEMORY, self.twist_memory),
            (laws.STRETCH_MEMORY, self.stretch_memory),
            (laws.CONTACT, self.contact),
            (laws.TABLE, self.table),
            (laws.FRICTION, self.friction),
            (laws.SELF_CONTACT, self.self_contact),
            (laws.STRETCH_DAMPING, self.stretch_damping),
        )
        for row, effect in effects:
            if effect is not None:
                active[row] = 1
                values = effect.parameters()
                parameters[row, : len(values)] = values
        if self.table is not None and self.contact is not None:
            # so that a cable at the table's height rests there
            parameters[laws.TABLE, 0] += self.contact.depth_under(max(0.0, -float(self.weight()[2])))
        return active, parameters

    def table_spacing(self, n_u: int) -> float:
        """Return the spacing of the nodes of contact with the table for `n_u` control points [m].

        A flat table can't pass between nodes. But when a cable strikes the table and unrolls on it, each node comes
        down by itself, which dissipates more energy the farther they are apart. With twist and obstacles they are as
        close as those for obstacles, because how evenly a bent cable is supported decides when its sections turn over.
        """
        if self.contact is None or self.table is None:
            return np.inf
        apart = self.scene.cable.length / max(_ON_TABLE, _OF_SPAN * (n_u - DEGREE))
        return apart if self.twist is None else min(apart, self.contact_spacing())

    def contact_spacing(self) -> float:
        """Return the spacing of the nodes of contact with obstacles [m]; infinite if there are none.

        Between nodes a cable that lies around something round sags towards it by at most _SAG of its diameter. On a peg
        of 2 cm nodes may be 2.1 mm apart; farther apart they would hold a cable that slides. Over an edge the cable
        slides from node to node unless they are much closer.
        """
        if self.contact is None or not self.obstacles:
            return np.inf
        cable = self.scene.cable
        closest = cable.diameter / _EDGES if self._meets_edges else self._round_spacing
        return max(closest, cable.length / MOST_NODES)

    def contact_cell(self) -> int:
        """Return how many of those nodes a single one may stand for, away from edges."""
        return max(1, int(self._round_spacing / self.contact_spacing())) if self._meets_edges else 1

    @property
    def _meets_edges(self) -> bool:
        """Whether an obstacle has edges that the cable may slide over."""
        flat = any(isinstance(o, Box | Cylinder) for o in self.obstacles)
        return (flat and not self.on_table) or any(isinstance(o, Box) for o in self.obstacles)

    @property
    def _round_spacing(self) -> float:
        """Spacing of contact nodes on round or flat surfaces [m]."""
        diameter = self.scene.cable.diameter
        radii = [0.5 * diameter + o.radius for o in self.obstacles if not isinstance(o, Box)]
        return min(diameter, float(np.sqrt(8.0 * _SAG * diameter * min(radii, default=np.inf))))

    def strand_spacing(self) -> float:
        """Return the spacing of the self-contact nodes [m], between which strands count as straight; or infinite.

        It is the same on every grid, because strands that strike each other at slightly different places may soon be
        far apart. It is half a diameter, or up to a whole one for a thin cable, to limit the number of nodes.
        """
        if self.self_contact is None:
            return np.inf
        length, diameter = self.scene.cable.length, self.scene.cable.diameter
        return max(min(diameter, max(0.5 * diameter, length / _SEGMENTS)), length / MOST_NODES)

    def stiffness_aside(self, pull: float = 0.0) -> float:
        """Return the approximate sideways stiffness of the cable by bending, weight and a pull [N]; [N/m^2]."""
        length = self.scene.cable.length
        bending = self.bend.bending_stiffness if self.bend else 0.0
        return bending / length**4 + (float(np.linalg.norm(self.weight())) + pull / length) / length

    def weight(self) -> Floats:
        """Return the weight per unit length in the solve's coordinates (nc,) [N/m]."""
        return np.zeros(self.nc) if self.gravity is None else self.rates(self.gravity.weight())


def pose(scene: Scene, called_for: Mapping[str, str] | None = None, *, at_rest: bool = False) -> Problem:
    """Turn a scene into the equations of its motion.

    Args:
        scene: the scene.
        called_for: effects that a result of this scene has called for, and the reason for each.
        at_rest: whether only an equilibrium is wanted, see `with_side` and `reached`.

    Raises:
        SceneError: no cable can follow the scene, or it switches off an effect that the rest of it needs.
    """
    instance("scene", scene, Scene, "a Scene")
    cable, environment = scene.cable, scene.environment
    start = brought(scene, start_curve(scene.shape, cable.length))
    check_reach(scene, start)
    table, switch = environment.table, scene.effects.get
    called_for = called_for or {}
    with_table = table is not None and switch("table", "auto") != "off"
    if with_table:
        check_above(scene, start)
    met = reached(scene, start, called_for, at_rest)
    check_outside(scene, start, met)
    start = cleared(scene, start, met, with_table)
    leaves = off_the_table(scene, start, met) if with_table else "there is no table"
    lies_over = not leaves
    leaves = leaves or called_for.get("side", "")
    on_table = not leaves
    if on_table:
        start = lay_on_table(scene, start)
    start = with_side(scene, start, at_rest)
    plane = find_plane(scene, start, on_table, bool(met))
    flat = rest_plane(scene, start) if "side" in called_for else None
    if flat is not None and flat.dimensions == 2:
        start = out_of_plane(scene, start, np.cross(*flat.axes))
        reason = called_for["side"] if plane.dimensions == 2 else plane.reason
        plane = Plane(np.eye(3), plane.origin, reason)
    bent = _is_bent(scene, start)
    bent_or_bowed = bent or start.bow != 0.0
    choices = choose(scene, start, plane.dimensions, on_table, lies_over, leaves, met, bent_or_bowed, called_for)
    if choices["self_contact"].active:
        check_apart(scene, start)
    if plane.dimensions == 3 and not choices["twist"].active:
        for name, wanted in (("cable.rest_shape", bent), ("effects.plasticity", choices["plasticity"].active)):
            if wanted:
                given = cable.rest_shape if bent else scene.effects.get("plasticity", "auto")
                reason = "In space, bends that the sections remember turn with them, which needs twist"
                raise SceneError(name, given, 'the same with effects.twist "on" or "auto"', reason)

    def active(name: str, present: bool = True) -> bool:
        return present and choices[name].active

    def yields(strain: float | None, scale: float = 1.0) -> tuple[float, float, float]:
        return scale * cast(float, strain), cast(float, cable.memory_rate), cable.hardening

    touches = active("table", not on_table) or active("obstacles")
    rubs = active("friction")
    lying = 0.0
    if on_table and rubs:
        assert table is not None
        lying = table.friction * cable.linear_density * abs(float(cast(Floats, environment.gravity)[2]))
    by_diameter = 2.0 / cable.diameter
    plastic, twisted = active("plasticity"), active("twist")
    return Problem(
        scene=scene,
        start=start,
        plane=plane,
        on_table=on_table,
        lies_over=lies_over,
        choices=choices,
        called_for=called_for,
        inertia=Inertia(cable.linear_density) if active("inertia") else None,
        drag=LinearDrag(environment.drag) if active("drag", environment.drag > 0) else None,
        gravity=Gravity(cable.linear_density, cast(Floats, environment.gravity)) if active("gravity") else None,
        stretch=Stretch(cast(float, cable.axial_stiffness)),
        # without inertia there are no waves to damp
        stretch_damping=StretchDamping(cast(float, cable.axial_damping))
        if active("inertia", cast(float, cable.axial_damping) > 0)
        else None,
        bend=Bend(cast(float, cable.bending_stiffness)) if active("bend") else None,
        damping=Damping(cable.bending_damping) if active("damping", cable.bending_damping > 0) else None,
        quadratic_drag=QuadraticDrag(environment.drag_quadratic)
        if active("drag", environment.drag_quadratic > 0)
        else None,
        twist=Twist(cast(float, cable.torsional_stiffness), cable.diameter) if twisted else None,
        twist_damping=TwistDamping(cable.torsional_damping)
        if twisted and active("damping", cable.torsional_damping > 0)
        else None,
        bending_memory=BendingMemory(*yields(cable.yield_strain, by_diameter))
        if plastic and cable.yield_strain is not None
        else None,
        twist_memory=TwistMemory(*yields(cable.yield_twist, by_diameter))
        if plastic and twisted and cable.yield_twist is not None
        else None,
        stretch_memory=StretchMemory(*yields(cable.yield_stretch))
        if plastic and cable.yield_stretch is not None
        else None,
        contact=Contact(0.5 * cable.diameter, _contact_stiffness(scene), cable.linear_density) if touches else None,
        table=TableContact(table.height - plane.origin[2], table.friction)
        if table is not None and active("table", not on_table)
        else None,
        friction=Friction(slip_of(cable.diameter, cable.length, np.inf), lying) if rubs else None,
        self_contact=SelfContact(cable.diameter, 10.0 * _contact_stiffness(scene), cable.linear_density)
        if active("self_contact")
        else None,
        obstacles=tuple(environment.obstacles[i] for i in met) if active("obstacles") else (),
    )


def stiffer(problem: Problem, ratio: float) -> Problem:
    """Return the problem with all contact stiffer by a ratio."""
    contact, own = problem.contact, problem.self_contact
    return replace(
        problem,
        contact=None if contact is None else replace(contact, stiffness=ratio * contact.stiffness),
        self_contact=None if own is None else replace(own, stiffness=ratio * own.stiffness),
    )


def stiffer_for(problem: Problem, deepest: float, speed: float = 0.0) -> Problem:
    """Return the problem with contact stiffer, so that a depth of `deepest` [m] becomes about the allowed one.

    At once contact is made at most _STIFFENING times as stiff, or as stiff as needed to stop an impact with a `speed`
    [m/s] at the allowed depth: critically damped, the depth of an impact is speed sqrt(mu/k)/e.
    """
    cable = problem.scene.cable
    allowed = DEEPEST * cable.diameter
    # for strands that strike each other, the depth goes only with the root of the stiffness
    ratio = min((1.5 * deepest / allowed) ** (1 if problem.self_contact is None else 2), _STIFFENING)
    contact = problem.self_contact or problem.contact
    assert contact is not None
    stops = cable.linear_density * (speed / (math.e * allowed)) ** 2
    return stiffer(problem, max(ratio, stops / contact.stiffness))


def stiff_as_taut(problem: Problem) -> Problem | None:
    """Return the problem with contact stiff enough for a taut cable around something; None if it is so already.

    Also None without contact. The displacement of the grippers is prescribed, so the deeper the cable sinks in, the
    less it is stretched. Contact of k = EA/(L D) takes up about half of that at an edge, and less on anything round; a
    much softer one takes up all of it. The same holds for a loop that is pulled tight around itself.
    """
    cable, contact = problem.scene.cable, problem.self_contact or problem.contact
    if contact is None:
        return None
    ratio = cast(float, cable.axial_stiffness) / (cable.length * cable.diameter * contact.stiffness)
    return stiffer(problem, ratio) if ratio > 1.0 else None


def firmer(problem: Problem, step: float) -> Problem:
    """Return the problem with the elastic slip of its friction adapted to steps of `step` [s]."""
    if problem.friction is None:
        return problem
    cable = problem.scene.cable
    return replace(problem, friction=replace(problem.friction, slip=slip_of(cable.diameter, cable.length, step)))


def _contact_stiffness(scene: Scene) -> float:
    """Return a contact stiffness [N/m^2] such that weight and bending press the cable in by 0.5 % of its diameter.

    The bending force is that of a tenth of the length, EI/(0.1 L)^3.
    """
    cable = scene.cable
    weight = cable.linear_density * float(np.linalg.norm(cast(Floats, scene.environment.gravity)))
    bending = cast(float, cable.bending_stiffness) / (0.1 * cable.length) ** 3
    return (weight + bending) / (0.005 * cable.diameter)


def _is_bent(scene: Scene, start: StartCurve) -> bool:
    """Return whether the stress-free shape is bent or twisted, so that it matters how the sections are turned."""
    rest, material = scene.cable.rest_shape, start.material
    if material is not None and bool(cast(Floats, material.memory).any()):
        return True
    if material is None and not isinstance(rest, str):
        return True
    return material is None and rest == "initial" and not start.bow and not is_straight(start)

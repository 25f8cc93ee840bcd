"""The motion of one rod: time steps as long as their estimated error allows, in windows between events."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.buckling import BOW
from dlocore.problem.problem import Problem
from dlocore.reference import body as places
from dlocore.reference.body import State, Tableau
from dlocore.reference.chain import Chain, Grip, chain, grip
from dlocore.reference.forces import goes_through
from dlocore.reference.rod import Memory, Rod, Snapshot
from dlocore.reference.step import DONE, take_step
from dlocore.scene.paths import Waypoints
from dlocore.solvers.monitor import TimeIsUp
from dlocore.statics.tipping import may_fall, to_a_side

Floats = NDArray[np.float64]

# Hairer and Wanner, Solving Ordinary Differential Equations II, table IV.6.5: order 4 with an error estimate of order 3
SDIRK4 = Tableau(
    coefficients=np.array(
        [
            [1 / 4, 0, 0, 0, 0],
            [1 / 2, 1 / 4, 0, 0, 0],
            [17 / 50, -1 / 25, 1 / 4, 0, 0],
            [371 / 1360, -137 / 2720, 15 / 544, 1 / 4, 0],
            [25 / 24, -49 / 48, 125 / 16, -85 / 12, 1 / 4],
        ]
    ),
    times=np.array([1 / 4, 3 / 4, 11 / 20, 1 / 2, 1]),
    error=np.array([-3 / 16, -27 / 32, 25 / 32, 0, 1 / 4]),
    order=4,
)
BACKWARD_EULER = Tableau(np.ones((1, 1)), np.ones(1), np.zeros(1), 1)
NEWTON = 1e-2  # of the tolerance of a step: the error that Newton's iteration leaves
FIRST = 1e-3  # of a window: the length of its first step
LAST = 1e-3  # of a step: a remainder of the window shorter than this is included in the step
SAFETY, SHRINK, GROW = 0.85, 0.2, 4.0  # of the choice of the next step
FAILURE = 0.25  # of a step that found no solution: the length of the next
NOTES = 2000  # of a motion, at most, between its events
SHORTEST = 1e-9  # of the horizon: the shortest step
DOWN = 1e-3  # [s]: the first step downhill; what friction holds in the end depends on longer ones
SETTLED = 1e-11  # of the length: a step downhill this short ends the search for an equilibrium
FARTHEST = 0.05  # of the length, in a step downhill: farther, the rod might pass through an obstacle
BENT = 8  # times that a motion is bent, to see how that disturbance develops
DOWNHILL = 2000  # steps to an equilibrium, at most
FALLS = 0.01  # of the length: a rod that ends farther away once it is tipped was not at a stable rest


Stopped = Literal["", "step", "time"]


class Watch(Protocol):
    """What is called between steps: it raises to end the solve."""

    def check(self) -> None:
        """Raise if the solve is to end."""
        ...


@dataclass(frozen=True, eq=False)
class Motion:
    """A simulated motion.

    Attributes:
        rod: the rod.
        times: of the recorded steps (k,) [s]; an event occurs twice, as a gripper may jump there.
        states: the rod at those times.
        given_times: of the forces and moments (m,) [s]: the middle between each pair of recorded steps, and both ends
            of each window between two events.
        forces: of each grasp (grasps, m, 3) [N], the mean between two recorded steps, which is what changes momentum;
            zero while it is open.
        moments: the same [N m].
        deepest: largest depth in a surface [m].
        left: largest update that Newton's iterations left [m].
        stopped: why it ended early: "step" without a solution, out of "time"; "" if it did not.
        steps: number of steps taken.
        rejected: number of steps that were repeated.
        tipped: whether its start was tipped off an unstable equilibrium.
    """

    rod: Rod
    times: Floats
    states: tuple[Snapshot, ...]
    given_times: Floats
    forces: Floats
    moments: Floats
    deepest: float
    left: float
    stopped: Stopped
    steps: int
    rejected: int
    tipped: bool


def events_of(problem: Problem) -> list[float]:
    """Return the times [s] within the horizon at which something given is not smooth, and its beginning and end."""
    horizon = problem.horizon
    found = set()
    for g in problem.scene.grasps:
        found |= {g.start, g.start + g.path.duration}
        found |= set() if g.release_time is None else {g.release_time}
        if isinstance(g.path, Waypoints):
            found |= {g.start + float(t) for t in (np.asarray(g.path.times)[0], *g.path.stops)}
    for load in problem.scene.loads:
        found |= set() if load.times is None else {float(t) for t in np.asarray(load.times)}
    inside = sorted(t for t in found if 1e-9 * horizon < t < (1.0 - 1e-9) * horizon)
    return [0.0, *inside, horizon]


class _Record:
    """What a simulation records as it proceeds."""

    def __init__(self, rod: Rod) -> None:
        self.rod = rod
        self.times: list[float] = []
        self.states: list[Snapshot] = []
        self.given: list[tuple[float, Floats, Floats]] = []
        self.deepest = self.left = 0.0
        self.steps = self.rejected = 0
        self.tipped = False

    def begin(self, link: Chain, state: State) -> None:
        """Record the state in which a window begins."""
        self.times.append(link.begin)
        self.states.append(link.snapshot(state))

    def note(self, link: Chain, t: float, state: State, impulse: Floats, twist: Floats) -> None:
        """Record the state at t [s], and the integrals of what grippers exerted on the cable since the last record.

        These are of the forces that hold the nodes (n, 4) [N s] and of the moments (n - 1, 3) [N m s].
        """
        grasps = self.rod.problem.scene.grasps
        begin = self.times[-1]
        middle, half = 0.5 * (begin + t), 0.5 * (t - begin)
        force, moment = np.zeros((len(grasps), 3)), np.zeros((len(grasps), 3))
        for k, held in enumerate(link.grips):
            i = next(i for i, g in enumerate(grasps) if g is held.grasp)
            nodes = link.node_of == held.node
            inertia = link.body.mass[nodes, 0].sum() * link.acceleration(held, middle, half)
            force[i] = (impulse[nodes, :3].sum(axis=0) / (t - begin) + inertia) @ self.rod.axes
            moment[i] = twist[link.edge_of == -1 - k].sum(axis=0) / (t - begin) @ self.rod.axes
        first, last = begin == link.begin, t == link.end
        at = (*([begin] if first else []), middle, *([t] if last else []))
        self.given += [(time, force, moment) for time in at]
        self.times.append(t)
        self.states.append(link.snapshot(state))

    def motion(self, stopped: Stopped) -> Motion:
        """Return what was recorded."""
        nothing = np.zeros((len(self.rod.problem.scene.grasps), 3))
        times, forces, moments = zip(*self.given or [(self.times[0], nothing, nothing)], strict=True)
        return Motion(
            rod=self.rod,
            times=np.array(self.times),
            states=tuple(self.states),
            given_times=np.array(times),
            forces=np.array(forces).transpose(1, 0, 2),
            moments=np.array(moments).transpose(1, 0, 2),
            deepest=self.deepest,
            left=self.left,
            stopped=stopped,
            steps=self.steps,
            rejected=self.rejected,
            tipped=self.tipped,
        )


def simulate(rod: Rod, tolerance: float, watch: Watch, bend: Callable[[Floats], Floats] | None = None) -> Motion:
    """Simulate a rod from its start to the horizon, each step with an estimated error of at most `tolerance` [m].

    `bend` gives displacements (n, 3) [m] for positions (n, 3) [m]. Nodes that no gripper holds are displaced by it at
    the beginning and, because a damped motion forgets its start, at each BENT-th of the time.

    Raises:
        what `watch.check` raises, except `TimeIsUp`.
    """
    problem = rod.problem
    grasps = problem.scene.grasps
    record = _Record(rod)
    closed: dict[int, Grip] = {}
    now = rod.start
    if problem.scene.shape.settle:
        with suppress(TimeIsUp):
            now, record.deepest = settled(rod, watch)
            fallen = _fallen(rod, now, watch) if may_fall(problem) else None
            now, record.tipped = fallen or now, fallen is not None
    bent = set() if bend is None else {k * problem.horizon / BENT for k in range(BENT)}
    for begin, end in pairwise(sorted({*events_of(problem), *bent})):
        if bend is not None and begin in bent:
            now = replace(now, x=now.x + bend(now.x))
        middle = 0.5 * (begin + end)
        hold = [i for i, g in enumerate(grasps) if g.start <= middle and (g.release_time or np.inf) > middle]
        closed = {i: closed.get(i) or grip(rod, grasps[i], now) for i in hold}
        link = chain(rod, tuple(closed.values()), begin, end)
        state = link.state(now)
        record.begin(link, state)
        try:
            ended = _window(link, state, tolerance, watch, record)
        except TimeIsUp:
            return record.motion("time")
        if ended is None:
            return record.motion("step")
        now = link.snapshot(ended)
    return record.motion("")


def _fallen(rod: Rod, rest: Snapshot, watch: Watch) -> Snapshot | None:
    """Return where a rod at rest falls when tipped by BOW of its length, or None if it comes back and so stays."""
    length = rod.problem.scene.cable.length
    way = BOW * length * to_a_side(rod.u / length)
    way[[rod.node(g.u) for g in rod.problem.scene.grasps if g.start == 0.0]] = 0.0
    if rod.planar:
        way[:, 2] = 0.0
    found, _ = settled(replace(rod, start=replace(rest, x=rest.x + way)), watch)
    return found if np.abs(found.x - rest.x).max() > FALLS * length else None


def _window(link: Chain, state: State, tolerance: float, watch: Watch, record: _Record) -> State | None:
    """Step through a window and return the state at its end, or None if a step finds no solution."""
    t, end = link.begin, link.end
    h = FIRST * (end - t)
    period, told = link.rod.problem.horizon, np.zeros(3)
    impulse, twist = np.zeros_like(state.q), np.zeros_like(state.t)
    while t < end:
        watch.check()
        h = end - t if end - t < (1.0 + LAST) * h else h
        after = State(*(np.zeros_like(x) for x in state))
        reaction, torque = np.zeros_like(state.q), np.zeros_like(state.t)
        guide = link.guide(t + h * SDIRK4.times)
        flag = take_step(link.body, SDIRK4, h, period, state, guide, NEWTON * tolerance, after, reaction, torque, told)
        failed = flag != DONE or goes_through(link.body, state.q, after.q)
        if failed or not told[0] <= tolerance:
            record.rejected += 1
            h *= FAILURE if failed else max(SHRINK, SAFETY * (tolerance / told[0]) ** (1.0 / SDIRK4.order))
            if h < SHORTEST * link.rod.problem.horizon:
                return None
            continue
        t = end if h == end - t else t + h
        record.steps += 1
        record.deepest, record.left = max(record.deepest, told[2]), max(record.left, told[1])
        after.q[:, 3] = 0.0  # spin counts from the beginning of the step
        state = after
        impulse += h * reaction
        twist += h * torque
        if t == end or t - record.times[-1] >= link.rod.problem.horizon / NOTES:
            record.note(link, t, state, impulse, twist)
            impulse[:], twist[:] = 0.0, 0.0
        h *= min(GROW, SAFETY * (tolerance / max(told[0], 1e-300)) ** (1.0 / SDIRK4.order))
    return state


def settled(rod: Rod, watch: Watch) -> tuple[Snapshot, float]:
    """Return the rod in equilibrium under the grasps' first poses, and the largest depth on its way there [m].

    The method is backward Euler downhill, in ever longer steps, under loads as they are before a jump at t = 0. The
    velocity is forgotten after each step, so that the rod goes where its energy falls; nothing yields on the way.
    """
    length = rod.problem.scene.cable.length
    law = rod.law.copy()
    law[places.YIELD_BEND : places.YIELD_STRETCH + 1] = np.inf
    rod = replace(rod, law=law)
    held = tuple(grip(rod, g, rod.start) for g in rod.problem.scene.grasps if g.start == 0.0)
    link = chain(rod, held, 0.0, rod.problem.horizon)
    state = link.state(rod.start)
    told = np.zeros(3)
    h, deepest = DOWN, 0.0
    for _ in range(DOWNHILL):
        watch.check()
        after = State(*(np.zeros_like(x) for x in state))
        guide = link.guide(np.zeros(1))
        for rate in (guide.velocity, guide.tangent_rate, guide.spin):
            rate[:] = 0.0
        guide.load[:] = link.loads(np.zeros(1), 0.0)
        flag = take_step(
            link.body, BACKWARD_EULER, h, 0.0, state, guide, 0.1 * SETTLED * length, after, np.zeros_like(state.q),
            np.zeros_like(state.t), told,
        )  # fmt: skip
        moved = float(np.abs(after.q[:, :3] - state.q[:, :3]).max())
        if flag != DONE or moved > FARTHEST * length or goes_through(link.body, state.q, after.q):
            h *= 0.25
            continue
        after.q[:, 3] = 0.0
        after.v[:] = 0.0
        state, deepest = after, max(deepest, told[2])
        if moved <= SETTLED * length and h >= 100.0:
            break
        h = min(2.0 * h, 1e3)
    rest = link.snapshot(state)
    resting = replace(
        rest,
        v=rod.start.v,
        kept=Memory(rest.kept.turn, rod.start.kept.memory),
        axial=rod.start.axial,
        anchor=np.zeros_like(rest.anchor),
    )
    return resting, deepest

"""A simulated motion at any time: positions between its steps, section angles, and what the sections remember."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.parts import MaterialMotion, StretchMotion
from dlocore.problem.plane import leftwards
from dlocore.reference import body as places
from dlocore.reference.motion import Motion
from dlocore.reference.rod import carried, unit

Floats = NDArray[np.float64]

KEPT = 33  # times, at most, at which memory and stretch of a motion are kept


def between(times: Floats, x: Floats, v: Floats, t: Floats) -> Floats:
    """Return x (k, ...) at times t (m,) [s] by cubic polynomials through x and v at the `times` (k,) of steps.

    If a time occurs twice, the velocity jumps. After the last time x is constant.
    """
    if len(times) == 1:
        return np.repeat(x, len(t), axis=0)
    at = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    while (np.diff(times)[at] <= 0.0).any():
        at = np.where(np.diff(times)[at] <= 0.0, at - 1, at)
    h = np.diff(times)[at]
    s = np.clip((t - times[at]) / h, 0.0, 1.0)
    shape = (-1,) + (1,) * (x.ndim - 1)
    s, h = s.reshape(shape), h.reshape(shape)
    p = s * s * (3.0 - 2.0 * s)
    rate = s * (1.0 - s) * h
    return np.asarray((1.0 - p) * x[at] + p * x[at + 1] + rate * ((1.0 - s) * v[at] - s * v[at + 1]))


@dataclass(frozen=True, eq=False)
class Samples:
    """What a motion went through.

    Attributes:
        u: of the nodes (n,) [m].
        times: of the steps (k,) [s].
        x, v: (k, n, 3) [m], [m/s] in the world.
        theta: angle of the sections at the nodes (k, n) [rad]; zero in the plane.
        director: that at u = 0 where theta is zero (k, 3).
    """

    u: Floats
    times: Floats
    x: Floats
    v: Floats
    theta: Floats
    director: Floats

    def positions(self, t: Floats) -> Floats:
        """Return the positions (m, n, 3) [m] at times t (m,) [s]."""
        return between(self.times, self.x, self.v, t)


def samples(motion: Motion) -> Samples:
    """Return what a motion went through, in the world."""
    rod = motion.rod
    x = rod.world(np.array([s.x for s in motion.states]))
    v = np.array([s.v for s in motion.states]) @ rod.axes
    tangents = np.array([s.t[0] for s in motion.states])
    directors = np.empty_like(tangents)
    theta = np.zeros(x.shape[:2])
    if rod.planar:
        directors = np.cross([0.0, 0.0, 1.0], tangents)
    else:
        turns = np.array([s.kept.turn.sum(axis=1) for s in motion.states])
        first = rod.problem.start(0.0, 1)[0]
        material = rod.problem.start.material
        given = leftwards(first) if material is None else np.asarray(material.director, dtype=float)
        d = unit(given - unit(first) * (unit(first) @ given))
        before, spun = unit(first), 0.0
        for k, t in enumerate(tangents):
            d = carried(before, t, d)
            directors[k], before = d, t
            a = motion.states[k].a[0]
            angle = np.arctan2(np.cross(d, a) @ t, d @ a)
            spun = angle + 2.0 * np.pi * np.round((spun - angle) / (2.0 * np.pi))
            theta[k, 0] = spun
        edges = theta[:, :1] + np.concatenate([np.zeros((len(x), 1)), np.cumsum(turns[:, 1:-1], axis=1)], axis=1)
        theta[:, 1:-1] = 0.5 * (edges[:, 1:] + edges[:, :-1])
        theta[:, 0] = edges[:, 0] - turns[:, 0]
        theta[:, -1] = edges[:, -1]
    return Samples(rod.u, motion.times, x, v, theta, directors @ rod.axes)


def stretch_of(motion: Motion) -> StretchMotion:
    """Return the stretch of the rod over a motion: at the middles of its edges, and extrapolated to both ends."""
    u = motion.rod.u
    at = _kept(motion)
    edges = np.array([np.linalg.norm(np.diff(motion.states[k].x, axis=0), axis=1) / np.diff(u) - 1.0 for k in at])
    first, last = (1.5 * edges[:, i] - 0.5 * edges[:, j] for i, j in ((0, 1), (-1, -2)))  # no force acts between
    return StretchMotion(
        times=motion.times[at],
        u=np.concatenate([u[:1], 0.5 * (u[1:] + u[:-1]), u[-1:]]),
        strain=np.column_stack([first, edges, last]),
    )


def _kept(motion: Motion) -> NDArray[np.int64]:
    """Return the times of a motion that are kept, each once."""
    at = np.unique(np.linspace(0, len(motion.times) - 1, KEPT).round().astype(int))
    return at[np.concatenate([[True], np.diff(motion.times[at]) > 0.0])]


def material_of(motion: Motion, taken: Samples) -> MaterialMotion | None:
    """Return what the sections remember over a motion; None if they are elastic, and straight whatever the start."""
    rod = motion.rod
    soft = rod.law[places.SOFTENED]
    yields = rod.law[places.MEMORY_RATE] > 0.0
    remembers = yields or np.any(rod.natural) or np.any(rod.start.kept.memory)
    if not (remembers or rod.problem.rests_as_it_begins):
        return None
    at = _kept(motion)
    inner = slice(1, -1)
    memory = np.array([motion.states[k].kept.memory[inner].mean(axis=1) for k in at])
    natural = rod.natural[inner]
    middles = 0.5 * (rod.u[1:] + rod.u[:-1])
    axial = np.array([np.interp(rod.u[inner], middles, soft * motion.states[k].axial) for k in at])
    return MaterialMotion(
        times=motion.times[at],
        director=taken.director[at],
        u=rod.u[inner],
        memory=natural + soft * (memory - natural),
        stretch=axial,
        natural=natural,
    )

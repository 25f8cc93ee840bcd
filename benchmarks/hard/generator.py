"""Random scenes, each determined by (seed, index) alone, and scenes as Python code."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.hard.draft import Draft, Rng, Room, chance, pick, spread
from benchmarks.hard.impossible import spoil
from benchmarks.hard.motions import SLACK, draw_motion, started
from benchmarks.hard.surroundings import (
    draw_damping,
    draw_drag,
    draw_environment,
    draw_gravity,
    draw_masses,
    draw_memory,
    draw_stiffness,
    draw_switches,
)
from dlocore import Move, Quality, Scene
from dlocore.problem.discretisation import smallest_n_u
from dlocore.problem.problem import pose
from dlocore.problem.time_grid import smallest_n_t

IMPOSSIBLE = 0.05  # share of scenes that no cable can follow
CROWDED = 1000  # seed from which on scenes have several obstacles
HEAVY = 2000  # seed from which on cables carry point masses; obstacles are as below CROWDED
SPLINED = 3000  # seed from which on smooth starts are given by control points; the rest is as below CROWDED


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A drawn scene.

    Attributes:
        seed, index: they alone determine the scene.
        families: kinds of hardness, "group: kind".
        possible: whether a cable can follow, as far as is known before the motion is solved (`judge.py`). If not, the
            scene must be refused or end with a status that says so.
        make: returns the scene, or raises SceneError.
    """

    seed: int
    index: int
    families: tuple[str, ...]
    possible: bool
    make: Callable[[], Scene]


def draw(seed: int, index: int, *, small: bool = False) -> Drawn:
    """Draw the scene `index` of a seed; `small` uses a grid of about ten by twenty control points, for quick tests.

    Scenes of seeds from CROWDED to HEAVY - 1 have two to four obstacles each; of other seeds, some scenes have one.
    From HEAVY to SPLINED - 1, the cables carry one to three point masses of a hundredth to three times their own mass.
    From SPLINED on, smooth starts are given by unevenly spaced control points.
    """
    r = np.random.default_rng([seed, index])
    length = 1.0 if chance(r, 0.6) else spread(r, 0.05, 50.0)
    thick = spread(r, 0.002, 0.02) if chance(r, 0.5) else 0.005 * length
    cable = {"diameter": min(thick, 0.04 * length), "linear_density": spread(r, 0.01, 1.0)}
    room = _room(r)
    d = Draft(length=length, cable=cable, room=room, gravity=draw_gravity(r, room), splined=seed >= SPLINED)
    if not 0.2 <= length <= 5.0:
        d.families.append("geometry: a cable of " + ("5 to 50 m" if length > 1 else "0.05 to 0.2 m"))
    draw_motion(r, d)
    _bring_within_reach(d)
    draw_environment(r, d, crowded=CROWDED <= seed < HEAVY)
    damping = draw_drag(r, d)
    draw_stiffness(r, d)
    draw_damping(r, d, damping)
    draw_memory(r, d)
    draw_switches(r, d)
    if HEAVY <= seed < SPLINED:
        draw_masses(r, d)
    possible = not chance(r, IMPOSSIBLE)
    if possible:
        _draw_quality(r, d, small)
        return Drawn(seed=seed, index=index, families=tuple(dict.fromkeys(d.families)), possible=True, make=d.scene)
    make = spoil(r, d)
    return Drawn(seed=seed, index=index, families=tuple(d.families), possible=False, make=make)


def _room(r: Rng) -> Room:
    return pick(r, {"flat": 4, "upright": 2, "space": 4})  # type: ignore[return-value]


def _bring_within_reach(d: Draft) -> None:
    """Shorten the moves until no two grippers are farther apart than the cable between them is long."""
    if len(d.grasps) < 2 or "motion: pulled taut" in d.families or "motion: two grasps 1 mm apart" in d.families:
        return
    start, t = started(d), np.linspace(0.0, d.horizon, 257)
    for _ in range(40):
        together = [g for g in d.grasps if (g.start == 0.0 and isinstance(g.path, Move)) or not g.path.duration]
        paths = [g.path.at(t, start(g.u)[0]) for g in together]
        strained = [
            float(np.linalg.norm(p - q, axis=1).max()) > max(SLACK, _at_start(p, q, abs(a.u - b.u))) * abs(a.u - b.u)
            for i, (a, p) in enumerate(zip(together, paths, strict=True))
            for b, q in zip(together[:i], paths[:i], strict=True)
        ]
        if not any(strained):
            return
        d.slower(0.8)


def _at_start(p: np.ndarray, q: np.ndarray, between: float) -> float:
    """Return the start distance of two grippers as a share of the cable between them, plus a hair."""
    return float(np.linalg.norm(p[0] - q[0])) / between + 1e-9


def _draw_quality(r: Rng, d: Draft, small: bool) -> None:
    """Draw the requested quality: mostly a target error, otherwise a grid and a method."""
    if small:
        problem = pose(d.scene())
        n_u, n_t = int(r.integers(9, 18)), int(r.integers(13, 26))
        n_u, n_t = max(n_u, smallest_n_u(problem)), max(n_t, smallest_n_t(problem))
        d.quality = Quality(n_u=n_u, n_t=n_t, method="march")
        return
    kind = pick(r, {"target": 64, "auto": 6, "march": 15, "grid": 11, "paper": 1, "odd": 3})
    d.families.append(f"numbers: {kind}")
    if kind in ("target", "auto"):
        d.quality = Quality(target_error=spread(r, 4e-3, 1e-2) * d.length) if kind == "target" else Quality()
        return
    if kind == "odd":
        n_u, n_t = int(r.integers(5, 130)), int(spread(r, 5, 514))
        n_t = min(n_t, 4000 // n_u + 5)
        delta, method = spread(r, 1e-10, 1e-2), pick(r, {"march": 2, "spacetime": 1})
    elif kind == "paper":
        n_u, n_t, delta, method = 7, 9, 1e-4 * d.length, "paper"
    else:
        n_u, n_t = int(r.integers(13, 34)), int(r.integers(25, 66))
        delta, method = min(spread(r, 1e-6, 1e-4) * d.length, 1e-2), "march" if kind == "march" else "auto"
        if kind == "grid":
            n_u, n_t = min(n_u, 21), min(n_t, 33)
    problem = pose(d.scene())
    if method == "paper" and problem.events:
        method = "march"  # the printed scheme can only solve one smooth motion
    n_u, n_t = max(n_u, smallest_n_u(problem)), max(n_t, smallest_n_t(problem))
    d.quality = Quality(n_u=n_u, n_t=n_t, delta=max(delta, 1e-10), method=method)  # type: ignore[arg-type]


def as_python(scene: Scene) -> str:
    """Return Python code that recreates the scene, after `from dlocore import *` and `from numpy import array`."""
    with np.printoptions(precision=17, threshold=1_000_000, linewidth=110):
        return repr(scene)

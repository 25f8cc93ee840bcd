"""The twist at which hanging wires flip, against measurements: `python -m benchmarks.wires DIRECTORY`.

DIRECTORY holds `<wire>_hang.npz` and `<wire>_hang.json` of three wires from github.com/qj25/adapteddlo_muj, which are
not part of this project. Each wire hangs as a U between two holders 0.12 m apart, from which it leaves horizontally and
outwards; there are 5 repeats of 51 points in a vertical plane. `critical_twist_deg_measured` is the rotation of the
holders relative to each other at which the U flips to a figure 8. The stiffnesses are those that the authors of the
data identified from the same shapes and twists, so this is a comparison of two rod models on one measurement rather
than a prediction.

Three answers are computed: the equilibrium under slowly growing rotation, a motion in time, and the boundary value
problem of Kirchhoff's rod, which uses none of the solver (docs/validation-wires.md).
"""

import argparse
import json
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_bvp
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from benchmarks.machine import machine_line
from dlocore import Cable, ControlPoints, Environment, Grasp, Move, Quality, Scene, equilibrium, predict
from dlocore.spline import design_matrix

Floats = NDArray[np.float64]
WIRES = ("black", "red", "white")
G = 9.81  # [m/s^2]
GAP = 0.12  # [m], between the holders
DIAMETER = 0.004  # [m], not measured; it sets the axial stiffness only, 16 EI/D^2
GRID = 33  # control points along the wire
DURATIONS = (20.0, 60.0, 240.0)  # [s] of the motions
STEP = np.radians(2.0)  # of the rotation, between equilibria near the flip


@dataclass(frozen=True, kw_only=True, eq=False)
class Wire:
    """A measured wire: its repeats (5, 51, 3) [m] from the right holder on, and what its authors fitted."""

    name: str
    repeats: Floats
    length: float
    density: float
    bending: float
    torsion: float
    critical: Floats  # [rad], measured

    @staticmethod
    def load(directory: Path, name: str) -> "Wire":
        facts = json.loads((directory / f"{name}_hang.json").read_text())
        bending = facts["bend_stiffness_EI_identified_Nm2"]["mean"]
        return Wire(
            name=name,
            repeats=np.load(directory / f"{name}_hang.npz")["markers"].astype(float),
            length=facts["length_m"],
            density=facts["linear_density_kg_per_m"],
            bending=bending,
            torsion=bending * facts["twist_over_bend_identified"],
            critical=np.radians(np.asarray(facts["critical_twist_deg_measured"], dtype=float)),
        )


def loop(length: float, gap: float) -> ControlPoints:
    """Return a start in the x-z plane that leaves both holders along x and turns once between: from 0 to -gap on x."""
    x = np.linspace(0.0, 1.0, 401)

    def angle(a: float) -> Floats:
        return -2 * np.pi * x - a * np.sin(2 * np.pi * x)

    a = brentq(lambda a: np.trapezoid(np.cos(angle(a)), x) + gap / length, -1.5, 1.5)
    path = make_interp_spline(x, np.column_stack([np.cos(angle(a)), 0 * x, np.sin(angle(a))]), k=3).antiderivative()
    at = np.linspace(0.0, 1.0, 41)
    along = ([(1, np.array([1.0, 0.0, 0.0]))], [(1, np.array([1.0, 0.0, 0.0]))])
    through = make_interp_spline(at * length, path(at) * length, k=3, bc_type=along)
    return ControlPoints(control_points=through.c, knots=through.t)


def hanging(wire: Wire, rotation: float = 0.0, duration: float = 1.0, **changes: Any) -> Scene:
    """Return the wire between its holders, which turn by half of `rotation` [rad] each, against each other."""
    turns = [
        Move(displacement=(0, 0, 0), rotation=(s * rotation, 0, 0), duration=duration, profile="linear")
        for s in (-0.5, 0.5)
    ]
    values: dict[str, Any] = {"shape": loop(wire.length, GAP), "horizon": duration}
    return Scene(
        cable=Cable(
            length=wire.length,
            diameter=DIAMETER,
            linear_density=wire.density,
            bending_stiffness=wire.bending,
            torsional_stiffness=wire.torsion,
            bending_damping=0.01 * wire.bending,
        ),
        grasps=tuple(Grasp(u=u, hold="clamp", path=p) for u, p in zip((0.0, wire.length), turns, strict=True)),
        **(values | changes),
    )


def heading(slope: Floats) -> Floats:
    """Return by how much the lowest point's direction (..., 3) has turned about the vertical [rad]: 0 in the U."""
    return np.abs(np.arctan2(slope[..., 1], -slope[..., 0]))


def shape_error(points: Floats, markers: Floats) -> float:
    """Return the rms distance [m] of points (51, 3) from markers (51, 3), the middles of their ends put together."""
    shift = 0.5 * (markers[0] + markers[-1]) - 0.5 * (points[0] + points[-1])
    return float(np.sqrt(((points + shift - markers) ** 2).sum(axis=1).mean()))


class Kirchhoff:
    """The symmetric equilibria of the hanging rod by a boundary value problem, in units of L, EI/L^2 and EI/L.

    r' = t, EI t' = M x t, M' + t x F = 0, F' = w z, with the twist moment p = M . t constant; inextensible. Turned by
    half a turn about the vertical through its lowest point the rod is itself, so that half of it is solved, with the
    heading of the lowest point given: past the flip there is still one solution for each heading.
    """

    def __init__(self, wire: Wire, gap: float = GAP) -> None:
        self.ratio = wire.torsion / wire.bending
        self.weight = wire.density * G * wire.length**3 / wire.bending
        self.gap = gap / wire.length
        self.length = wire.length
        start = loop(1.0, self.gap)
        s = np.linspace(0.0, 0.5, 401)
        through = [np.asarray(part) for part in _spline(start, s)]
        moment = np.cross(through[1], through[2])
        state = np.concatenate([through[0], through[1], moment, 0 * moment], axis=1).T
        state[11] = 0.0
        self._s, self._y, self._p = s, state, np.zeros(1)
        for weight in np.linspace(0.0, self.weight, 16):  # from weightless on
            self._solve(0.0, weight)

    def at(self, psi: float) -> float:
        """Return the rotation of the holders against each other [rad] at which the lowest point has turned by `psi`."""
        self._solve(psi, self.weight)
        s = np.linspace(0.0, 0.5, 2001)
        slope = self._sol(s)[3:6].T
        slope /= np.linalg.norm(slope, axis=1)[:, None]
        other = (slope * [1.0, 1.0, -1.0])[::-1]
        return float(self._p[0]) / self.ratio + _holonomy(np.vstack([slope, other[1:]]))

    def positions(self, count: int) -> Floats:
        """Return `count` (odd) points (count, 3) [m] of the last solution, evenly spaced."""
        half = self._sol(np.linspace(0.0, 0.5, count // 2 + 1))[:3].T
        other = (half * [-1.0, -1.0, 1.0] - [self.gap, 0.0, 0.0])[::-1]
        return np.vstack([half, other[1:]]) * self.length

    def _solve(self, psi: float, weight: float) -> None:
        def rates(s: Floats, y: Floats, p: Floats) -> Floats:
            t, moment, force = y[3:6], y[6:9], y[9:12]
            zero = np.zeros_like(s)
            return np.vstack([t, np.cross(moment, t, axis=0), np.cross(force, t, axis=0), zero, zero, zero + weight])

        def boundary(a: Floats, b: Floats, p: Floats) -> Floats:
            start = [a[0], a[1], a[2], a[3] - 1.0, a[4], a[5], a[6] - p[0]]
            turned = b[4] * np.cos(psi) - b[3] * np.sin(psi)
            return np.array([*start, b[0] + self.gap / 2, b[1], b[5], turned, b[11], b[8]])

        found = solve_bvp(rates, boundary, self._s, self._y, p=self._p, tol=1e-6, max_nodes=20000)
        if not found.success:
            raise RuntimeError(f"the boundary value problem at {np.degrees(psi):.0f} degrees: {found.message}")
        self._sol, self._p = found.sol, found.p
        self._s = np.linspace(0.0, 0.5, 801)
        self._y = found.sol(self._s)


def _spline(shape: ControlPoints, u: Floats) -> list[Floats]:
    """Return r, r' and r'' (k, 3) of a start shape at u (k,)."""
    control = np.asarray(shape.control_points)[:, :3]
    return [design_matrix(np.asarray(shape.knots), u, order) @ control for order in (0, 1, 2)]


def _holonomy(tangents: Floats) -> float:
    """Return the angle [rad] by which a director comes back that was transported along tangents (n, 3) from x to x."""
    first = director = np.array([0.0, 1.0, 0.0])
    for a, b in pairwise(tangents):
        axis, cos = np.cross(a, b), a @ b
        director = cos * director + np.cross(axis, director) + axis * (axis @ director) / (1 + cos)
    angle = np.arctan2(np.cross(first, director) @ tangents[-1], first @ director)
    return float(angle)


def critical_of_kirchhoff(wire: Wire, gap: float = GAP) -> tuple[float, float]:
    """Return the greatest rotation [rad] that a symmetric equilibrium bears, and the heading [rad] there."""
    rod = Kirchhoff(wire, gap)
    headings = np.radians(np.arange(0.0, 130.0, 2.5))
    rotations = np.unwrap([rod.at(psi) for psi in headings])
    k = int(np.argmax(rotations))
    return float(rotations[k]), float(headings[k])


def critical_of_equilibria(wire: Wire, n_u: int = GRID, largest: float = 1.5) -> tuple[float, float]:
    """Return the rotation [rad] at which slowly followed equilibria flip, and the heading [rad] just before.

    The holders turn in steps, small near the flip, each equilibrium the start of the next. Without self-contact the
    figure 8 goes on through itself and loses two turns: the twist falls at once. NaN if none flips below `largest`
    times the measured mean.
    """
    mean = float(wire.critical.mean())
    rotation, twist, turned = 0.0, 0.0, 0.0
    found = equilibrium(hanging(wire), n_u=n_u)
    while rotation < largest * mean:
        step = STEP if rotation > 0.8 * mean else 0.1 * mean
        unstretched = np.zeros(len(found.control_points))
        shape = ControlPoints(control_points=found.control_points, knots=found.knots_u, strain=unstretched)
        found = equilibrium(hanging(wire, step, shape=shape), at=1.0, n_u=n_u)
        rotation += step
        now = float(found.control_points[-1, 3] - found.control_points[0, 3])
        if now < twist - np.pi:
            return rotation - 0.5 * step, turned
        twist, turned = now, float(heading(_slope(found.control_points, found.knots_u)))
    return float("nan"), turned


def _slope(control: Floats, knots: Floats) -> Floats:
    return (design_matrix(knots, [0.5 * knots[-1]], 1) @ control)[0, :3]


def critical_of_motion(wire: Wire, duration: float, drag: float = 0.05, n_u: int = GRID) -> float:
    """Return the rotation [rad] at which the lowest point has turned by a right angle while the holders turn evenly."""
    rotation = 1.3 * float(wire.critical.mean())
    scene = hanging(
        wire,
        rotation,
        duration,
        shape=replace(loop(wire.length, GAP), settle=True),
        environment=Environment(drag=drag),
        quality=Quality(n_u=n_u, n_t=min(513, int(4 * duration) + 5), method="march", estimate=False),
    )
    found = predict(scene, keep_grid=True)
    t = np.linspace(0.0, duration, 2001)
    turned = heading(found.surface([0.5 * wire.length], t, du=1)[:, 0, :3])
    past = np.flatnonzero(turned > np.radians(120.0))
    return float(rotation * t[past[0]] / duration) if len(past) else float("nan")


def row(wire: Wire) -> dict[str, float]:
    """Return what one wire gives: lengths in mm, angles in degrees."""
    u = np.linspace(0.0, wire.length, wire.repeats.shape[1])
    began = perf_counter()
    rest = equilibrium(hanging(wire), n_u=GRID)
    points = rest.positions(u)
    mean = wire.repeats.mean(axis=0)
    out = {
        "EI": wire.bending,
        "GJ/EI": wire.torsion / wire.bending,
        "shape": 1e3 * float(np.mean([shape_error(points, m) for m in wire.repeats])),
        "scatter": 1e3 * float(np.mean([shape_error(m, mean) for m in wire.repeats])),
        "measured": float(np.degrees(wire.critical.mean())),
        "sd": float(np.degrees(wire.critical.std(ddof=1))),
    }
    rod = Kirchhoff(wire)
    rod.at(0.0)
    out["rod"] = 1e3 * shape_error(points, rod.positions(len(points)))
    out["kirchhoff"] = float(np.degrees(critical_of_kirchhoff(wire)[0]))
    out["statics"] = float(np.degrees(critical_of_equilibria(wire)[0]))
    for duration in DURATIONS:
        out[f"motion {duration:.0f} s"] = float(np.degrees(critical_of_motion(wire, duration)))
    out["seconds"] = perf_counter() - began
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directory", type=Path, help="folder with black_hang.npz, black_hang.json, red_..., white_...")
    wires = [Wire.load(parser.parse_args().directory, name) for name in WIRES]
    print(machine_line())
    rows = [row(wire) for wire in wires]
    print(f"{'':>32}" + "".join(f"{wire.name:>12}" for wire in wires))
    for key in rows[0]:
        print(f"{LABELS.get(key, f'critical, {key} [deg]'):>32}" + "".join(f"{r[key]:12.4g}" for r in rows))


LABELS = {
    "EI": "EI [N m^2]",
    "shape": "shape, rms to repeats [mm]",
    "scatter": "repeats, rms to mean [mm]",
    "rod": "shape, rms to BVP [mm]",
    "GJ/EI": "GJ/EI",
    "seconds": "seconds",
    "measured": "critical, measured [deg]",
    "sd": "its scatter [deg]",
    "kirchhoff": "critical, BVP [deg]",
    "statics": "critical, equilibria [deg]",
}


if __name__ == "__main__":
    main()

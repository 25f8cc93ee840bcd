"""What the choices of the discretisation are worth: `python -m benchmarks.choices`.

- The final worst error of a march on the paper's case, relative to the converged motion: with the solver as it is, and
  with one choice undone (the quadrature of the stretch and bending energies, the knots, the numerical damping of the
  time steps).
- The energy of a free, undamped motion, which should be constant, over the numerical damping.
- A bent wire that a clamp carries and turns at its middle: its largest error anywhere, with and without kinks in the
  angle of the sections there.
- Straight wires with one bend that swing slowly: how far they are from rigid bodies.
- A bent rod that springs straight in resisting air: its largest error anywhere, with and without the fast waves in its
  first acceleration.
"""

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.hard.curves import arc, bend
from benchmarks.machine import machine_line
from benchmarks.paper_case import errors, paper_scene, reference
from dlocore import Cable, Environment, Grasp, Move, Points, Prediction, Quality, Scene, Straight, energies, predict
from dlocore.kernels.basis import GAUSS_2, AxialPoints, basis_rows, build_tables, graded_knots
from dlocore.levels import given
from dlocore.levels import level as levels
from dlocore.problem import discretisation
from dlocore.problem.features import find_features
from dlocore.solvers import stretch
from dlocore.spline import uniform_knots

GAUSS_1 = np.polynomial.legendre.leggauss(1)
GRIDS = ((9, 13), (13, 19), (17, 25))
RADII = (0.0, 0.5, 0.7, 0.9, 1.0)  # spectral radii at infinite frequency
BENDING = 0.1  # [N m^2] of the stiff cable
TURNED = (13, 19, 28, 41, 62)  # control points of the bent wire
FINEST = 129
BENDS = ((30, 0.005), (50, 0.005), (90, 0.01), (90, 0.06), (170, 0.02), (170, 0.06))  # angle [degrees], width [m]
SLOWLY = 20.0  # [s]
SPRINGS = 0.4  # [s]
TIMES = np.array([0.5, 1.0, 2.0, 5.0, 10.0])  # [s]
FIRST_MARCH = patch.object(given, "_OTHERWISE", ())  # is the answer, also where it folds the cable
GENERAL = patch.object(levels, "march_smooth", lambda *_: None)  # the compiled march makes its own tables
ALL_ACCELERATION = patch.object(stretch, "lasting", lambda axes, q, a, G, *_: (a, G))  # that a stretch begins with
CASES = tuple(product((1e-2, 1e-3), (0.0, 0.25, 0.5, 0.8)))  # EI [N m^2], grasp [m]


def gauss_rows(knots: Any, rule: tuple[Any, Any], derivatives: int) -> tuple[Any, Any, Any, Any]:
    """Return the points of a Gauss rule in every span, their weights, and `basis_rows` there."""
    spans = np.unique(knots)
    half = 0.5 * np.diff(spans)[:, None]
    u = (spans[:-1, None] + half * (1.0 + rule[0])).ravel()
    return u, (half * rule[1]).ravel(), *basis_rows(knots, u, derivatives)


def stretch_points(rule: tuple[Any, Any]) -> Callable[..., Any]:
    """Return a `build_tables` with the same Gauss rule for the stretch in every span."""

    def build(knots: Any, *arguments: Any) -> Any:
        u, w, first, table = gauss_rows(knots, rule, 1)
        points = AxialPoints(u, first, np.ascontiguousarray(table[:, 1]), w, np.ones(len(w)))
        return build_tables(knots, *arguments)._replace(axial=points)

    return build


def bending_points(rule: tuple[Any, Any]) -> Callable[..., Any]:
    """Return a `build_tables` with this Gauss rule for the bending in every span; of a motion in the plane."""

    def build(knots: Any, *arguments: Any) -> Any:
        u, w, first, table = gauss_rows(knots, rule, 2)
        b0, b1, b2 = (np.ascontiguousarray(table[:, order]) for order in range(3))
        tables = build_tables(knots, *arguments)
        return tables._replace(curvature=tables.curvature._replace(u=u, first=first, b0=b0, b1=b1, b2=b2, w=w))

    return build


def uniform(n: int, length: float, *arguments: Any) -> Any:
    """Return uniform knots, whatever is grasped."""
    return uniform_knots(n, length)


def ungraded(n: int, length: float, features: Any, multiplicity: Any, power: Any, width: Any) -> Any:
    """Return knots at the grasps, but not graded towards them."""
    return graded_knots(n, length, features, multiplicity, np.zeros_like(power), width)


def damped(rho: float) -> dict[str, Any]:
    """Return the change to a march of spectral radius `rho`."""
    return {"march_level": partial(given.march_level, rho=rho)}


CHOICES: dict[str, tuple[Any, dict[str, Any]]] = {
    "as it is": (given, {"march_level": given.march_level}),
    "stretch: 1 point in every span": (discretisation, {"build_tables": stretch_points(GAUSS_1)}),
    "stretch: 2 points in every span": (discretisation, {"build_tables": stretch_points(GAUSS_2)}),
    "bending: 1 point in every span": (discretisation, {"build_tables": bending_points(GAUSS_1)}),
    "bending: 2 points in every span": (discretisation, {"build_tables": bending_points(GAUSS_2)}),
    "knots: at the grasp, not graded": (discretisation, {"graded_knots": ungraded}),
    "knots: uniform": (discretisation, {"graded_knots": uniform}),
    **{f"steps: rho = {rho:g}": (given, damped(rho)) for rho in RADII},
}


def print_errors() -> None:
    truths = {case: reference(paper_scene(*case, Quality()))[0] for case in CASES}
    print("final worst error [mm], median and largest of 8 cases")
    print(f"{'':34}" + "".join(f"{f'{n_u} x {n_t}':>18}" for n_u, n_t in GRIDS))
    for name, (module, changes) in CHOICES.items():
        cells = []
        for n_u, n_t in GRIDS:
            quality = Quality(n_u=n_u, n_t=n_t, method="march", estimate=False)
            with FIRST_MARCH, GENERAL, patch.multiple(module, **changes):
                motions = {case: predict(paper_scene(*case, quality), keep_grid=True) for case in CASES}
            worst = [1e3 * errors(m.surface.sample()[2][..., :3], truths[c])["final"] for c, m in motions.items()]
            cells.append(f"{np.median(worst):9.2f}{max(worst):9.2f}")
        print(f"{name:34}" + "".join(cells))


def print_energies() -> None:
    move = Move(displacement=(0.0, 0.3, 0.0), duration=0.3)
    scene = Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=BENDING),
        shape=Straight(),
        grasps=(Grasp(u=0.25, path=move, release_time=0.4),),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        horizon=10.0,
        quality=Quality(n_u=13, n_t=201, method="march", estimate=False),
    )
    print("energy but that of stretch at 1, 2, 5 and 10 s over that at 0.5 s: a stiff cable let go at 0.4 s, undamped")
    for rho in RADII:
        with FIRST_MARCH, GENERAL, patch.multiple(given, **damped(rho)):
            surface = predict(scene, keep_grid=True).surface
        parts = energies(scene, surface, TIMES)
        energy = parts["kinetic"] + parts["bend"]  # the fit in time does not resolve the waves of the stretch
        print(f"{f'steps: rho = {rho:g}':34}" + "".join(f"{e:10.3g}" for e in energy[1:] / energy[0]))


def print_kinks() -> None:
    turn = Move(displacement=(-0.1, 0.1, -0.1), rotation=(0.3, -0.4, 0.2), duration=0.9)
    scene = Scene(
        cable=Cable.preset("paper", rest_shape="initial"),
        shape=Points(points=arc(1.0, 2.0, "flat")),
        grasps=(Grasp(u=0.6, hold="clamp", path=turn),),
        environment=Environment(drag=0.1),
        effects={"self_contact": "off"},
    )
    without = patch.object(discretisation, "find_features", lambda *_: find_features(*_[:4]))
    u, t = np.linspace(0.0, 1.0, 65), np.linspace(0.0, 0.9, 33)

    def motion(n_u: int) -> Any:
        quality = Quality(n_u=n_u, n_t=60, method="march", estimate=False)
        return predict(replace(scene, quality=quality), keep_grid=True).surface.positions(u, t)

    truth = motion(FINEST)
    print("largest error [mm] of a bent wire that a clamp carries and turns by its middle")
    print(f"{'':34}" + "".join(f"{n_u:10}" for n_u in TURNED))
    for name, change in (("as it is", nullcontext()), ("no kinks of the sections' angle", without)):
        with change:
            worst = [1e3 * float(np.linalg.norm(motion(n_u) - truth, axis=-1).max()) for n_u in TURNED]
        print(f"{name:34}" + "".join(f"{x:10.2f}" for x in worst))


def swinging(angle: float, width: float, quality: Quality) -> Scene:
    """Return a wire without weight that is bent at 0.45 m, clamped at its beginning and turned there about itself."""
    turn = Move(displacement=(0.0, 0.0, 0.0), rotation=(np.pi / 2, 0.0, 0.0), duration=SLOWLY)
    damped = {"bending_damping": 0.02, "torsional_damping": 0.02}
    return Scene(
        cable=Cable(
            length=1.0, diameter=0.005, linear_density=0.2, bending_stiffness=0.2, rest_shape="initial", **damped
        ),
        shape=Points(points=bend(1.0, np.radians(angle), width, 0.45)),
        grasps=(Grasp(u=0.0, hold="clamp", path=turn),),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        horizon=SLOWLY,
        quality=quality,
    )


def from_rigid(found: Prediction) -> float:
    """Return the largest distance at the end [m] of a `swinging` wire from its start turned as a rigid body."""
    u = np.linspace(0.0, 1.0, 65)
    start, end = found.surface.positions(u, [0.0, SLOWLY])
    x, y, z = (start - start[0]).T
    return float(np.linalg.norm(end - start[0] - np.column_stack([x, -z, y]), axis=1).max())


def print_swings() -> None:
    print("distance [mm] from a rigid body of a wire with one bend that swings slowly by 90 degrees")
    print(f"{'':34}" + "".join(f"{n_u:10}" for n_u in TURNED))
    for angle, width in BENDS:
        grids = [Quality(n_u=n_u, n_t=25, method="march", estimate=False) for n_u in TURNED]
        off = [1e3 * from_rigid(predict(swinging(angle, width, quality), keep_grid=True)) for quality in grids]
        name = f"{angle} degrees along {1e3 * width:g} mm"
        print(f"{name:34}" + "".join(f"{x:10.3f}" for x in off))


def sprung(quality: Quality) -> Scene:
    """Return a rod that is bent by 2 rad and held by a direction at its beginning, and springs straight."""
    return Scene(
        cable=Cable(length=1.0, diameter=0.01, linear_density=0.1, bending_stiffness=1.0),
        shape=Points(points=arc(1.0, 2.0, "flat")),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.5, drag_quadratic=0.5),
        effects={"self_contact": "off"},
        horizon=SPRINGS,
        quality=quality,
    )


def print_springs() -> None:
    u, t = np.linspace(0.0, 1.0, 65), np.linspace(0.0, SPRINGS, 41)

    def motion(n_u: int, n_t: int) -> Any:
        quality = Quality(n_u=n_u, n_t=n_t, method="march", estimate=False)
        return predict(sprung(quality), keep_grid=True).surface.positions(u, t)

    truth = motion(TURNED[-1], 513)
    print("largest error [mm] of a bent rod that springs straight, on 61 control points in time")
    print(f"{'':34}" + "".join(f"{n_u:10}" for n_u in (*TURNED, FINEST)))
    for name, change in (("as it is", nullcontext()), ("all of the first acceleration", ALL_ACCELERATION)):
        with GENERAL, change:
            worst = [1e3 * float(np.linalg.norm(motion(n_u, 61) - truth, axis=-1).max()) for n_u in (*TURNED, FINEST)]
        print(f"{name:34}" + "".join(f"{x:10.2f}" for x in worst))


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    print_errors()
    print_energies()
    print_kinks()
    print_swings()
    print_springs()
    print(machine_line())


if __name__ == "__main__":
    main()

"""Scenes and measures that the solver tests share."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.hard.curves import corner
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    SplineSurface,
    Straight,
    Table,
    Waypoints,
    predict,
)

Floats = NDArray[np.float64]
G = 9.81  # [m/s^2]
WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
PAPER_GRID = Quality(n_u=9, n_t=13, delta=1e-5)
PAPER_GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m]


def cable(**changes: Any) -> Cable:
    """Return the cable of the paper's case, 1 m long and 5 mm thick, with the given fields replaced."""
    values = {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3}
    return Cable(**(values | changes))


def march(n_u: int, n_t: int, **changes: Any) -> Quality:
    """Return the quality of one march on a given grid."""
    return Quality(**({"n_u": n_u, "n_t": n_t, "method": "march", "estimate": False} | changes))


def paper_scene(u: float, EI: float = 1e-3, *, hold: str = "point", quality: Quality = PAPER_GRID) -> Scene:
    """Return the paper's case: a straight cable on a table, moved 0.5 m sideways in 1.6 s at `u`."""
    path = Move(displacement=(0.0, 0.5, 0.0), duration=1.6)
    return Scene(
        cable=cable(bending_stiffness=EI),  # EA = 16 EI/D^2 by itself
        shape=Straight(),
        grasps=(Grasp(u=u, hold=hold, path=path),),  # type: ignore[arg-type]
        environment=Environment(drag=0.05, table=Table()),
        quality=quality,
    )


def converged(scene: Scene) -> Prediction:
    """Return a prediction that met its target."""
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    return prediction


def without_table(scene: Scene) -> Scene:
    """Return a scene on a frictionless table as one without weight, which is the same motion."""
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=scene.environment.drag)
    return replace(scene, environment=around)


def refined(scene: Scene, target_error: float) -> Prediction:
    """Return the march that is refined until two grids agree to three quarters of `target_error` [m]."""
    prediction = predict(replace(scene, quality=Quality(target_error=target_error)))
    assert prediction.status == "converged", prediction.message
    return prediction


def samples(scene_or_surface: Scene | SplineSurface, k_u: int = 101, k_t: int = 33) -> tuple[Floats, Floats]:
    """Return k_u material coordinates [m] and k_t times [s], evenly spaced over a scene or a surface."""
    if isinstance(scene_or_surface, Scene):
        length, horizon = scene_or_surface.cable.length, float(scene_or_surface.horizon or 0.0)
    else:
        length, horizon = scene_or_surface.length, scene_or_surface.horizon
    return np.linspace(0.0, length, k_u), np.linspace(0.0, horizon, k_t)


def apart(a: SplineSurface, b: SplineSurface) -> Floats:
    """Return the distances (33, 101) [m] of two surfaces of the same cable and horizon."""
    u, t = samples(a)
    return np.linalg.norm(a.positions(u, t) - b.positions(u, t), axis=-1)


def rms(distances: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt((distances**2).mean()))


def along(surface: SplineSurface) -> tuple[Floats, Floats]:
    """Return Gauss points u (k,) [m] of the surface's spans and their weights (k,) [m]."""
    x, w = np.polynomial.legendre.leggauss(4)
    cuts = np.unique(surface.knots_u)
    half = 0.5 * np.diff(cuts)[:, None]
    return (cuts[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()


def momentum(surface: SplineSurface, density: float, t: Floats) -> tuple[Floats, Floats]:
    """Return linear (k, 3) [kg m/s] and angular momentum about the origin (k, 3) [kg m^2/s] at the times t (k,)."""
    u, w = along(surface)
    r, v = surface(u, t)[..., :3], surface(u, t, dt=1)[..., :3]
    return density * np.einsum("u,kud->kd", w, v), density * np.einsum("u,kud->kd", w, np.cross(r, v))


def centre(surface: SplineSurface, t: Floats) -> Floats:
    """Return the centre of mass (k, 3) [m] at the times t (k,)."""
    u, w = along(surface)
    return np.einsum("u,kud->kd", w / w.sum(), surface.positions(u, t))


def arc(length: float, angle: float, count: int = 41) -> Floats:
    """Return points (count, 3) of an arc in the x-y plane from the origin that turns left by `angle` [rad]."""
    turned = np.linspace(0.0, angle, count)
    return length / angle * np.column_stack([np.sin(turned), 1.0 - np.cos(turned), np.zeros(count)])


def swinging(quality: Quality) -> Scene:
    """Return a limp cable hung by its end and carried off, whose free end cracks and trembles on."""
    return Scene(
        cable=Cable(length=0.6, diameter=0.005, linear_density=0.08, bending_stiffness=1.2e-4),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, hold="tangent", path=Move(displacement=(0.3, 0.0, 0.0), duration=0.6)),),
        environment=Environment(drag=0.013),
        horizon=1.6,
        quality=quality,
    )


def jerked(n_t: int, way: float = 0.1, duration: float = 0.3) -> Scene:
    """Return the cable that swings, jerked at once to its speed: its least squares does not converge."""
    path = Move(displacement=(way, 0.0, 0.0), duration=duration, profile="linear")
    scene = swinging(Quality(n_u=17, n_t=n_t, delta=1e-9))
    return replace(scene, grasps=(Grasp(u=0.0, path=path),))


def kinked(quality: Quality) -> Scene:
    """Return a wire that is bent by a right angle within a hundredth of its length, and carried by its end."""
    return Scene(
        cable=Cable(
            length=1.0, diameter=0.004, linear_density=0.05, bending_stiffness=0.02, rest_shape="initial"
        ),
        shape=Points(points=corner(1.0, 0.5 * np.pi, 0.4, "upright")),
        grasps=(Grasp(u=0.0, hold="clamp", path=Move(displacement=(0.0, 0.2, 0.1), duration=0.5)),),
        environment=Environment(drag=0.1),
        horizon=0.8,
        quality=quality,
    )  # fmt: skip


def arch_with_feet_close_for(dwell: float) -> Scene:
    """Return an arch on a sloping table, which would fall sideways while its feet are close for a time `dwell` [s]."""
    turn = np.linspace(-1.3, 1.3, 41)
    points = np.column_stack([np.sin(turn), np.cos(turn), 0.0 * turn]) / 2.6
    times = np.linspace(0.0, 86.0 + dwell, 962)

    def smooth(x: Floats) -> Floats:
        y = np.clip(x / 2.0, 0.0, 1.0)
        return np.asarray(y**3 * (10.0 - 15.0 * y + 6.0 * y * y))

    close = 0.3 * (smooth(times - 18.0) - smooth(times - 20.0 - dwell))[:, None]
    left, right = (
        Waypoints(times=times, positions=foot + way * close * [1.0, 0.0, 0.0])
        for foot, way in ((points[0], 1.0), (points[-1], -1.0))
    )
    return Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=2.3e-3),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.0, hold="tangent", path=left), Grasp(u=1.0, hold="tangent", path=right)),
        environment=Environment(gravity=(0.0, -9.81, 0.0), drag=0.2, table=Table()),
        quality=Quality(target_error=0.01),
    )

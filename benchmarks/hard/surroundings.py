"""The surroundings of a drawn motion, and stiffness, damping and yield that suit it."""

import numpy as np

from benchmarks.hard.draft import Draft, Floats, Rng, Room, chance, in_room, pick, spread
from benchmarks.hard.motions import started
from dlocore import Box, Capsule, Cylinder, PointMass, Sphere, Straight, Table
from dlocore.effects.distance import distances

STRAIN = 1 / 300  # the largest strain by weight and inertia: such a cable keeps its length
STIFFEST = 1e9  # EA L^2/EI


def draw_gravity(r: Rng, room: Room) -> float:
    """Draw the magnitude of gravity [m/s^2]; zero on a smooth table or far from any."""
    kinds = {
        "flat": {"0": 3, "9.81": 5},
        "upright": {"0": 1, "9.81": 8, "100": 1},
        "space": {"0": 2, "9.81": 6, "100": 1},
    }
    return float(pick(r, kinds[room]))


def draw_environment(r: Rng, d: Draft, *, crowded: bool) -> None:
    """Draw gravity, a table and obstacles: two to four obstacles if crowded, otherwise one in some scenes."""
    d.environment["gravity"] = (0.0, 0.0, -d.gravity)
    kind = {0.0: "weightless", 100.0: "gravity of 100 m/s^2"}.get(d.gravity, "gravity")
    if d.room == "flat" and d.gravity > 0:
        kind = pick(r, {"smooth table": 2, "rough table": 3})
        d.environment["table"] = Table(friction=r.uniform(0.05, 0.8) if kind == "rough table" else 0.0)
    d.families.append(f"effects: {kind}")
    if crowded:
        for _ in range(int(r.integers(2, 5))):
            _add_obstacle(r, d, kind)
    elif chance(r, 0.12 if kind in ("smooth table", "rough table", "gravity") else 0.0):
        _add_obstacle(r, d, kind)


def _add_obstacle(r: Rng, d: Draft, kind: str) -> None:
    """Put a solid in the way of the cable, clear of its start and of the grasped points."""
    start, length = started(d), d.length
    points = start(np.linspace(0.0, length, 201))
    friction = float(r.choice([0.0, r.uniform(0.1, 0.5)]))
    t = np.linspace(0.0, d.horizon, 129)
    paths = [g.path.at(t - g.start, start(g.u)[0]) for g in d.grasps]
    for _ in range(20):
        radius = r.uniform(0.02, 0.12) * length
        from_there = points[int(r.integers(len(points)))]
        away = in_room(r, "flat") if "table" in kind else np.array([0.0, 0.0, -1.0]) + 0.3 * in_room(r, "space")
        center = from_there + away * (radius + r.uniform(0.01, 0.15) * length)
        solid: Sphere | Cylinder | Capsule | Box
        if "table" in kind:
            center = np.array([center[0], center[1], 0.0])
            solid = Cylinder(center=center, radius=radius, height=max(0.2 * length, 4 * d.diameter), friction=friction)
        else:
            shape = pick(r, {"sphere": 2, "capsule": 2, "box": 1})
            axis = in_room(r, "flat") * 0.5 * length
            if shape == "sphere":
                solid = Sphere(center=center, radius=radius, friction=friction)
            elif shape == "capsule":
                solid = Capsule(start=center - axis, end=center + axis, radius=radius, friction=friction)
            else:
                solid = Box(center=center, size=np.array([4.0, 4.0, 2.0]) * radius, friction=friction)
        row = np.array([solid.row()])
        clear = np.concatenate([points, *paths])
        if distances(row, np.ascontiguousarray(clear)).min() > 2.0 * d.diameter + 0.005 * length:
            d.environment["obstacles"] = (*d.environment.get("obstacles", ()), solid)
            d.families.append("effects: obstacle")
            return


def draw_stiffness(r: Rng, d: Draft) -> None:
    """Draw the stiffnesses: EI over six decades, EA such that the forces of the motion keep the length, GJ freely."""
    cable, length = d.cable, d.length
    mu = cable["linear_density"]
    EI = spread(r, 1e-6, 4.0)
    if chance(r, 0.75):  # as stiff, relative to its weight, as a wire, a cable or a pole
        EI = float(np.clip(9.81 * mu * length**3 * spread(r, 1e-3, 3.0), 1e-6, 4.0))
    drag = d.environment.get("drag", 0.0) + d.environment.get("drag_quadratic", 0.0) * d.speed
    forces = mu * (length * (d.gravity + d.acceleration) + 9.0 * d.speed**2) + drag * d.speed * length
    EA = max(16 * EI / d.diameter**2, forces / STRAIN, mu * (d.jump / STRAIN) ** 2)
    if chance(r, 0.3):
        EA = max(EA, EI / length**2 * spread(r, 1e7, STIFFEST))
        d.families.append("stiffness: true EA")
    EI = max(EI, EA * length**2 / STIFFEST)
    cable["bending_stiffness"], cable["axial_stiffness"] = EI, EA
    if EA * length**2 / EI > 1e8:
        d.families.append("stiffness: EA L^2/EI above 1e8")
    limp = EI / (mu * length**3 * max(9.81, d.acceleration))
    if limp < 1e-4:
        d.families.append("stiffness: limp")
    elif limp > 1.0:
        d.families.append("stiffness: stiff")
    ratio = spread(r, 0.01, 100.0) if chance(r, 0.4) else spread(r, 0.5, 1.6)
    cable["torsional_stiffness"] = ratio * EI
    if not 0.1 < ratio < 10.0:
        d.families.append("stiffness: GJ/EI far from 1")


def draw_masses(r: Rng, d: Draft) -> None:
    """Draw one to three point masses, half of them at an end, and raise EA to suit their forces."""
    total = spread(r, 0.01, 3.0) * d.cable["linear_density"] * d.length
    shares = r.dirichlet(np.ones(int(r.integers(1, 4))))
    places = [d.length * (float(r.integers(0, 2)) if chance(r, 0.5) else r.uniform(0.0, 1.0)) for _ in shares]
    masses = [PointMass(u=u, mass=total * float(share)) for u, share in zip(places, shares, strict=True)]
    d.cable["point_masses"] = tuple(masses)
    d.cable["axial_stiffness"] *= 1.0 + total / (d.cable["linear_density"] * d.length)
    d.families.append("stiffness: point masses")


def draw_drag(r: Rng, d: Draft) -> str:
    """Draw the drag, and return the kind of damping."""
    # a cable that buckles without damping throws itself about, and no two grids agree
    buckles = "motion: post-buckling" in d.families
    kind = pick(r, {"none": 0 if buckles else 1, "usual": 5, "heavy": 1, "quadratic": 1})
    mu, time = d.cable["linear_density"], d.time
    if kind != "usual":
        d.families.append(f"stiffness: damping {kind}")
    if kind in ("usual", "quadratic"):
        d.environment["drag"] = mu / (spread(r, 0.1, 3.0) * time)
    if kind == "quadratic":
        d.environment["drag_quadratic"] = mu / (d.length * spread(r, 0.05, 2.0))
    if kind == "heavy":
        d.environment["drag"] = mu / (spread(r, 0.003, 0.05) * time)
    return kind


def draw_damping(r: Rng, d: Draft, kind: str) -> None:
    """Draw the internal damping."""
    if chance(r, 0.25) or kind == "heavy":
        rate = spread(r, 1e-3, 0.1 if kind == "usual" else 1.0) * d.time
        d.cable["bending_damping"] = d.cable["bending_stiffness"] * rate
        d.cable["torsional_damping"] = d.cable["torsional_stiffness"] * rate


def draw_memory(r: Rng, d: Draft) -> None:
    """Draw how a bent start keeps its shape, and a yield threshold near the curvatures of the motion.

    A stiff cable that is bent and released at t = 0 springs away within milliseconds, so few scenes begin like this.
    """
    if not isinstance(d.shape, Straight):
        weight = d.cable["linear_density"] * d.length**3 * max(d.gravity, 9.81)
        limp = d.cable["bending_stiffness"] < 3e-4 * weight
        held = bool(d.grasps) and all(g.start == 0.0 for g in d.grasps)
        kind = pick(r, {"bent by itself": 4, "settled": 4 if held and _rests(d) else 0, "springs": 4 if limp else 0.6})
        if kind == "bent by itself":
            d.cable["rest_shape"] = "initial"
            d.families.append("effects: bent stress-free shape")
        elif kind == "settled":
            settle(d)
        elif not limp:
            d.families.append("geometry: springs away at the start")
    if chance(r, 0.08):
        kappa = max(_largest_bend(d), 2.0 / d.length)
        near = float(r.choice([1.0 - 1e-3, 1.0 + 1e-3, spread(r, 0.5, 4.0)]))
        d.cable["yield_strain"] = min(0.5 * d.diameter * kappa * near, 1.0)
        d.cable["memory_rate"] = spread(r, 1.0, 100.0) / d.time
        d.cable["hardening"] = r.uniform(0.05, 1.0)
        d.families.append("effects: plasticity")


def _rests(d: Draft) -> bool:
    """Tell whether the grippers and the weight determine where the cable comes to rest."""
    weight = d.gravity > 0 and "table" not in d.environment
    return weight or len(d.grasps) > 1 or d.grasps[0].hold != "point"


def settle(d: Draft) -> None:
    """Let the start relax to equilibrium."""
    assert d.shape is not None
    d.shape = type(d.shape)(**{**vars(d.shape), "settle": True})
    d.families.append("geometry: settled start")


def _largest_bend(d: Draft) -> float:
    start = started(d)
    u = np.linspace(0.0, d.length, 101)
    first, second = start(u, 1), start(u, 2)
    bends: Floats = np.linalg.norm(np.cross(first, second), axis=1) / np.linalg.norm(first, axis=1) ** 3
    return float(np.quantile(bends, 0.9))


def draw_switches(r: Rng, d: Draft) -> None:
    if chance(r, 0.06) and d.room == "space":
        d.effects["twist"] = "on"
        d.families.append("effects: twist switched on")
    if chance(r, 0.04):
        d.effects["inertia"] = "on"
    if chance(r, 0.1):
        d.effects["self_contact"] = "off"

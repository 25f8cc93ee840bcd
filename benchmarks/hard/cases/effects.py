"""Effects that jump: contact, friction, yield."""

from dataclasses import replace

import numpy as np

from benchmarks.hard import curves
from benchmarks.hard.cases.base import DEEPEST, WEIGHTLESS, case, cord, depth, move, overlap, samples
from benchmarks.premises import ends_on, sticks_and_slips, strands_meet, touches, touches_again, yields
from dlocore import (
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Load,
    Points,
    Prediction,
    Scene,
    Sphere,
    Straight,
    Table,
    Waypoints,
)

SHALLOW = "all laws; nothing is deeper than a quarter of the diameter"


def _away(p: Prediction, beyond: float = 0.0) -> float:
    """Return how far the points with u of at least `beyond` go from where they were [m]."""
    u, t = samples(p)
    u = u[u >= beyond]
    return float(np.linalg.norm(p.surface.positions(u, t) - p.surface.positions(u, 0.0), axis=-1).max())


@case(
    "effects",
    "all laws; the half that is not pulled sticks",
    error=lambda p: _away(p, beyond=0.5),
    within=1e-3,
    premise=sticks_and_slips,
)
def stick_slip() -> Scene:
    """An end is dragged aside and back, so slowly that points stick and slip one after another."""
    t = np.linspace(0.0, 4.0, 41)
    s = 1.0 - np.abs(t - 2.0) / 2.0
    way = s**3 * (10 - 15 * s + 6 * s**2)
    path = Waypoints(times=t, positions=np.column_stack([0.06 * way**2, 0.15 * way, 0 * t]))
    around = Environment(table=Table(friction=0.6))
    return Scene(cable=cord(), shape=Straight(), grasps=(Grasp(u=0.0, path=path),), environment=around)


@case("effects", "at rest: friction bears what is less than mu N", error=_away, within=1e-4)
def pulled_with_less_than_friction_bears() -> Scene:
    """A table that slopes by 0.3 of gravity with a friction of 0.4: nothing moves, nothing creeps."""
    around = Environment(gravity=(0.0, 2.9, -9.4), table=Table(friction=0.4))
    grasps = (Grasp(u=0.0),)
    return Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=around, horizon=1.0)


@case("effects", SHALLOW, error=depth, within=DEEPEST, premise=touches_again("table"))
def contact_that_opens_and_closes() -> Scene:
    """A cable in space is lowered onto the table, lifted and lowered again."""
    t = np.linspace(0.0, 3.0, 31)
    way = np.column_stack([0.05 * t, 0 * t, 0.15 + 0.14 * np.cos(2 * np.pi * t / 1.5)])
    shape = Straight(start=(0, 0, 0.29))
    grasps = (Grasp(u=0.0, hold="tangent", path=Waypoints(times=t, positions=way)),)
    around = Environment(drag=0.2, table=Table(friction=0.3))
    return Scene(cable=cord(bending_stiffness=1e-1), shape=shape, grasps=grasps, environment=around)


@case("effects", SHALLOW, error=depth, within=DEEPEST, premise=touches("obstacles[0]"))
def falling_on_an_obstacle() -> Scene:
    """A level cable falls freely on a bar: everything stops at one point at once."""
    bar = Capsule(start=(0.45, -0.3, -0.15), end=(0.45, 0.3, -0.15), radius=0.03, friction=0.3)
    around = Environment(drag=0.1, obstacles=(bar,))
    return Scene(cable=cord(), shape=Straight(), environment=around, horizon=0.4)


@case("effects", SHALLOW, error=depth, within=DEEPEST, premise=ends_on("obstacles[0]"))
def dragged_around_a_peg() -> Scene:
    """A cable on a rough table is pulled against a thin peg and bends around it."""
    peg = Cylinder(center=(0.15, 0.05, 0.0), radius=0.01, height=0.1, friction=0.3)
    grasps = (Grasp(u=0.0, path=move(0.05, 0.3, time=1.5)),)
    around = Environment(drag=0.05, table=Table(friction=0.3), obstacles=(peg,))
    return Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=around)


@case("effects", "all laws", premise=touches("obstacles[0]"))
def swung_against_a_ball() -> Scene:
    """A hanging cable is swung against a ball: contact away from every grasp, in space."""
    ball = Sphere(center=(0.25, 0.0, -0.5), radius=0.08, friction=0.2)
    grasps = (Grasp(u=0.0, path=move(0.4, 0.02, 0.0, time=1.0)),)
    around = Environment(drag=0.1, obstacles=(ball,))
    shape = Straight(direction=(0, 0, -1))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=around, horizon=1.2)


def _bent(near: float) -> Scene:
    """Return a bend to the share `near` of the yield curvature: the end goes along that of an arc of even curvature."""
    turn = 1.2  # [rad] over one metre
    t = np.linspace(0.0, 3.0, 61)
    bend = np.maximum(turn * (t / 3.0) ** 3 * (10 - 15 * t / 3.0 + 6 * (t / 3.0) ** 2), 1e-6)
    end = np.column_stack([np.sin(bend) / bend, (1 - np.cos(bend)) / bend, 0 * t])
    quaternions = np.column_stack([np.cos(bend / 2), 0 * t, 0 * t, np.sin(bend / 2)])
    path = Waypoints(times=t, positions=end, orientations=quaternions)
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, hold="tangent", path=path))
    cable = cord(yield_strain=0.5 * 0.005 * turn / near, memory_rate=20.0, bending_stiffness=1e-2)
    return Scene(cable=cable, shape=Straight(), grasps=grasps, environment=replace(WEIGHTLESS, drag=0.5))


def _remembered(p: Prediction) -> float:
    """Return the largest curvature that the sections keep [1/m], where they have to keep none."""
    return 0.0 if p.material is None else float(np.abs(p.material.memory[-1]).max())


def _nearly_yields(p: Prediction) -> bool:
    """Return whether the largest curvature is within a tenth of the one that yields."""
    cable = p.scene.cable
    assert cable.yield_strain is not None
    u, t = samples(p)
    return 0.9 < float(p.surface.curvature(u, t).max()) * 0.5 * cable.diameter / cable.yield_strain < 1.0


@case(
    "effects",
    "no memory: the yield curvature is not reached",
    error=_remembered,
    within=0.05,
    premise=_nearly_yields,
)
def bent_to_just_below_yield() -> Scene:
    """95 % of the yield curvature: an overshoot of the solver would be remembered for good."""
    return _bent(0.95)


@case("effects", "all laws", premise=yields)
def bent_to_just_beyond_yield() -> Scene:
    """102 % of the yield curvature: sections yield or not by errors of two per cent, and what yields bends more."""
    return _bent(1.02)


@case("effects", "a straight line of constant velocity", error=lambda p: _from_flight(p), within=1e-6)
def no_gravity() -> Scene:
    """Nothing holds, pulls or bends: the mass matrix is all there is."""
    shape = Straight(velocity=(0.3, -0.2, 0.1))
    return Scene(cable=cord(), shape=shape, environment=WEIGHTLESS, horizon=1.0)


def _from_flight(p: Prediction) -> float:
    u, t = samples(p)
    flight = np.column_stack([u, 0 * u, 0 * u]) + np.outer(t, [0.3, -0.2, 0.1])[:, None]
    return float(np.linalg.norm(p.surface.positions(u, t) - flight, axis=-1).max())


@case("effects", "all laws")
def gravity_of_100() -> Scene:
    """Ten times the weight: a hanging cable is swung, with tension and whips to match."""
    points = curves.arc(1.0, 1.6, "upright")
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(-0.2, 0.1, 0.1, time=0.6)))
    around = Environment(gravity=(0, 0, -100.0), drag=0.3)
    return Scene(
        cable=cord(axial_stiffness=2e4), shape=Points(points=points, settle=True), grasps=grasps, environment=around
    )


@case("effects", "all laws; strands stay a diameter apart", error=overlap, within=0.02 * 0.005, premise=strands_meet)
def strands_pressed_together() -> Scene:
    """A hairpin in space is closed, and forces along its two strands press them together."""
    points = curves.hairpin(1.0, 0.06, "flat")
    path = move(0, -0.06 + 0.006, 0.0)
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, hold="tangent", path=path))
    ways = {**dict.fromkeys((0.1, 0.2, 0.3), 0.02), **dict.fromkeys((0.7, 0.8, 0.9), -0.02)}  # [N]
    loads = [Load(u=u, force=[[0, 0, 0], [0, force, 0]], times=[0.0, 1.0]) for u, force in ways.items()]
    return Scene(
        cable=cord(rest_shape="initial"),
        shape=Points(points=points),
        grasps=grasps,
        loads=loads,
        environment=replace(WEIGHTLESS, drag=0.5),
    )

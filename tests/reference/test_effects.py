"""Exact cases of what is not smooth: yielding, friction, contact."""

import numpy as np
import pytest

from dlocore import Cylinder, Environment, Grasp, Load, Move, Points, Scene, Straight, Table, Waypoints
from dlocore.reference import surface
from dlocore.reference.body import RADIUS
from dlocore.reference.rod import solid
from dlocore.reference.sampling import material_of, samples
from tests.reference.rods import cable, motion


def rolled(kappa, times):
    """Return waypoints of the end of a 0.5 m cable that is bent to uniform curvatures (k,) [1/m] from its other end."""
    angle = np.maximum(0.5 * kappa, 1e-12)
    places = 0.5 * np.column_stack([np.sin(angle) / angle, (1 - np.cos(angle)) / angle, 0 * angle])
    turns = np.column_stack([np.cos(angle / 2), 0 * angle, 0 * angle, np.sin(angle / 2)])
    return Waypoints(times=times, positions=places, orientations=turns)


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_a_wire_bent_and_let_go_keeps_what_is_beyond_the_threshold(space):
    most, hardening = 4.0, 1.0
    made = cable(
        length=0.5,
        linear_density=0.002,
        axial_stiffness=1e3,
        yield_strain=0.01,
        memory_rate=100.0,
        hardening=hardening,
        bending_damping=1e-4,
    )
    t = np.linspace(0.0, 4.0, 81)
    path = rolled(most * 0.5 * (1 - np.cos(np.pi * t / 4.0)), t)
    scene = Scene(
        cable=made,
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="tangent"), Grasp(u=0.5, hold="tangent", path=path, release_time=4.0)),
        environment=Environment(gravity=(0, 0, 0), drag=0.02),
        effects={"twist": "on"} if space else {},
        horizon=6.0,
    )
    found = motion(scene, 12, 1e-7)
    material = material_of(found, samples(found))
    threshold = 2 * 0.01 / 0.01
    kept = (most - threshold) / (1 + hardening)
    # the bend passes the threshold at up to 3 1/m in a second, over 200/s; the waypoints leave the circle a little
    np.testing.assert_allclose(np.linalg.norm(material.memory[-1, :, :2], axis=1), kept, rtol=0.05)
    heading = np.arctan2(*(found.states[-1].t[-1] @ found.rod.axes)[[1, 0]])
    assert heading == pytest.approx(
        kept * 0.5, rel=0.1
    )  # less the half hinges at its ends; it stands with the bend it keeps


def test_friction_stops_a_sliding_cable_after_v2_over_2_mu_g():
    scene = Scene(
        cable=cable(),
        shape=Straight(velocity=(0.4, 0.8, 0.0)),
        environment=Environment(table=Table(friction=0.3)),
        horizon=1.0,
    )
    found = motion(scene, 10, 1e-6)
    way = 0.8 / (2 * 0.3 * 9.81) * np.array([0.4, 0.8]) / np.sqrt(0.8)
    stick = 0.02 * 0.01  # it holds within that
    np.testing.assert_allclose(found.states[-1].x[0, :2] @ found.rod.axes[:2, :2], way, atol=3 * stick)
    np.testing.assert_allclose(found.states[-1].v, 0.0, atol=1e-6)


@pytest.mark.parametrize("on", [False, True], ids=["in its plane", "by contact"])
def test_a_cable_at_rest_on_a_table_sticks_under_a_force_below_mu_n(on):
    force = 0.9 * 0.3 * 0.05 * 9.81
    scene = Scene(
        cable=cable(axial_stiffness=1e4),
        shape=Straight(),
        loads=(Load(u=0.0, force=(-force, 0, 0)),),
        environment=Environment(table=Table(friction=0.3)),
        effects={"table": "on"} if on else {},
        horizon=1.0,
    )
    found = motion(scene, 10, 1e-6)
    assert found.rod.planar == (not on)
    moved = samples(found).x[-1] - samples(found).x[0]
    # it gives way by less than the elastic slip of friction, and stretches by 4 P^2/(2 EA mu w) at most
    assert np.abs(moved).max() < 0.02 * 0.01 + 2e-5
    half = samples(found).positions(np.array([0.5]))[0]
    np.testing.assert_allclose(half, samples(found).x[-1], atol=2e-6)  # and stays there
    assert found.deepest < 0.01 * 0.01


def test_a_belt_around_a_smooth_or_rough_peg_obeys_eytelwein():
    """The tension grows by exp(mu phi) around a peg, phi the angle of wrap."""
    radius, leg = 0.05, 0.3
    for friction in (0.0, 0.3):
        made = cable(
            length=2 * leg + 0.5 * np.pi * radius, diameter=0.004, bending_stiffness=1e-6, axial_stiffness=200.0
        )
        phi = np.linspace(0.0, 0.5 * np.pi, 41)
        bend = radius * np.column_stack([np.sin(phi), 1 - np.cos(phi)])
        before = np.column_stack([np.linspace(-leg, 0.0, 41)[:-1], np.zeros(40)])
        after = np.column_stack([np.full(40, radius), radius + np.linspace(0.0, leg, 41)[1:]])
        peg = Cylinder(center=(0.0, radius, 0.0), radius=radius - 0.002, height=0.2, friction=friction)
        load = 0.5
        scene = Scene(
            cable=made,
            shape=Points(points=np.vstack([before, bend, after])),
            grasps=(Grasp(u=0.0, path=Move(displacement=(-0.02, 0.0, 0.0), duration=1.0, profile="linear")),),
            loads=(Load(u=made.length, force=(0.0, load, 0.0)),),
            environment=Environment(gravity=(0, 0, 0), drag=0.05, table=Table(), obstacles=(peg,)),
            horizon=1.0,
        )
        found = motion(scene, 60, 2e-6, stiffening=1e3)
        settled = found.given_times > 0.6
        pull = np.trapezoid(found.forces[0, settled, 0], found.given_times[settled]) / np.ptp(
            found.given_times[settled]
        )
        # the drag of the way, 0.02 m/s over 0.7 m, is 1e-3 of it; waves of the stretch go to and fro
        assert -pull == pytest.approx(load * np.exp(friction * 0.5 * np.pi), rel=0.02)


def test_a_cable_dropped_on_a_table_lies_on_it_and_not_in_it():
    made = cable(bending_damping=1e-4, axial_stiffness=100.0)
    scene = Scene(
        cable=made,
        shape=Straight(start=(0, 0, 0.01)),
        environment=Environment(drag=0.05, table=Table(friction=0.3)),
        horizon=0.4,
    )
    found = motion(scene, 10, 1e-5)
    height = samples(found).x[-1, :, 2]
    np.testing.assert_allclose(
        height, 0.0, atol=0.002 * 0.01
    )  # the surface is so high that what rests on it is at zero
    fall = np.sqrt(2 * 9.81 * 0.01)  # how deep it strikes: v sqrt(mu/k)/e of a critically damped blow, and more
    assert found.deepest < 2.0 * fall * np.sqrt(0.05 / (found.rod.law[RADIUS + 1]))


def test_distances_are_those_of_the_solids():
    n = np.empty(3)
    row = solid(Cylinder(center=(0.1, 0.0, 0.0), radius=0.2, height=0.6, axis=(0.0, 1.0, 0.0)), False)
    for point, distance, normal in (
        ((0.1, 0.0, 0.5), 0.3, (0, 0, 1)),
        ((0.1, 0.5, 0.0), 0.2, (0, 1, 0)),
        ((0.4, 0.7, 0.0), np.hypot(0.1, 0.4), np.array([0.1, 0.4, 0.0]) / np.hypot(0.1, 0.4)),
        ((0.1, -0.29, 0.0), -0.01, (0, -1, 0)),
    ):
        assert surface.gap(row, np.array(point), n) == pytest.approx(distance, abs=1e-12)
        np.testing.assert_allclose(n, normal, atol=1e-12)

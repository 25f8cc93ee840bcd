"""Static equilibria against closed forms (docs/model.md; Love, Timoshenko and Gere, Bisshopp and Drucker)."""

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from dlocore import (
    Cable,
    ControlPoints,
    Environment,
    Equilibrium,
    Grasp,
    Load,
    Move,
    Points,
    Quality,
    Scene,
    Straight,
    Table,
    Waypoints,
    equilibrium,
)
from tests.solver.scenes import WEIGHTLESS, G, arc, cable

EI, MU = 1e-3, 0.05
CLAMPED = Grasp(u=0.0, hold="tangent")


def cantilever(a: float) -> Equilibrium:
    """Return a cantilever under a tip force P = a EI/L^2."""
    load = Load(u=1.0, force=(0.0, 0.0, -a * EI))
    scene = Scene(cable=cable(), shape=Straight(), grasps=(CLAMPED,), loads=(load,), environment=WEIGHTLESS, horizon=1)
    return equilibrium(scene)


def test_small_cantilever_sinks_by_pl3_over_3ei():
    tip = cantilever(1e-3).positions(1.0)[0]
    # the next term of the series is 4 a^2/35 smaller relatively; the answer is refined to 1e-4 of L, here by far better
    assert -tip[2] == pytest.approx(1e-3 / 3, rel=1e-6)


@pytest.mark.parametrize(("sag", "off"), [(0.1, 0.008), (0.2, 0.033)])
def test_a_piece_that_sticks_out_over_an_edge_tells_its_stiffness(sag, off):
    """As docs/cable.md says: EI = mu g l^4/(8 s), which is too large by so much."""
    free = cable(bending_stiffness=MU * G / (8 * sag * (1 + off)))  # l = 1 m
    tip = equilibrium(Scene(cable=free, shape=Straight(), grasps=(CLAMPED,), horizon=1)).positions(1.0)[0]
    assert -tip[2] == pytest.approx(sag, rel=2e-3)


def test_what_a_gripper_gives_to_a_level_cable_acts_on_the_cable_about_the_grasped_point():
    stiff = cable(bending_stiffness=10.0)
    level = equilibrium(Scene(cable=stiff, shape=Straight(start=(2, 3, 4)), grasps=(CLAMPED,), horizon=1))
    np.testing.assert_allclose(level.reactions[0], [0.0, 0.0, MU * G], atol=1e-4)  # N: it carries the weight
    np.testing.assert_allclose(level.moments[0], [0.0, -MU * G / 2, 0.0], atol=1e-3)  # N m: and holds it up


@pytest.mark.parametrize(
    ("a", "shortening", "deflection"),
    [(1, 0.05643, 0.30172), (2, 0.16064, 0.49346), (3, 0.25442, 0.60325), (5, 0.38763, 0.71379), (10, 0.555, 0.81061)],
)
def test_large_cantilever_bends_as_the_elastica(a, shortening, deflection):
    tip = cantilever(a).positions(1.0)[0]
    # five digits in the table, and the axial stretch P L/EA of 1.6e-5
    np.testing.assert_allclose([1 - tip[0], -tip[2]], [shortening, deflection], atol=3e-5)


def test_an_end_moment_of_2_pi_ei_over_l_rolls_the_cable_to_a_circle():
    turn = np.linspace(0.0, 2 * np.pi, 25)
    ends = np.vstack([[1.0, 0.0, 0.0], *[arc(1.0, x, 2)[1:] for x in turn[1:]]])
    quaternions = np.column_stack([np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)])
    path = Waypoints(times=np.linspace(0.0, 1.0, 25), positions=ends, orientations=quaternions)
    grasps = (CLAMPED, Grasp(u=1.0, hold="tangent", path=path))
    rolled = equilibrium(Scene(cable=cable(), shape=Straight(), grasps=grasps, environment=WEIGHTLESS), at=1.0)
    assert rolled.status == "converged"
    u = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(rolled.positions(u), arc(1.0, 2 * np.pi, 101), atol=1e-4)  # the asked refinement
    np.testing.assert_allclose(rolled.moments[1], [0, 0, 2 * np.pi * EI], atol=2e-3 * 2 * np.pi * EI)
    np.testing.assert_allclose(rolled.moments[0], -rolled.moments[1], atol=2e-3 * 2 * np.pi * EI)
    assert rolled.energy == pytest.approx(2 * np.pi**2 * EI, rel=1e-4)
    assert np.abs(rolled.reactions).max() < 2e-3 * 4 * np.pi**2 * EI  # none in a circle; of EI kappa^2


def hanging_arc(angle: float) -> np.ndarray:
    """Return points of an arc that hangs in the x-z plane between two ends on the x-axis."""
    c, s = np.cos(angle / 2), np.sin(angle / 2)
    return (arc(1.0, angle) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]).T)[:, [0, 2, 1]]


@pytest.mark.parametrize(("ratio", "sag"), [(1.1, 0.20030), (1.25, 0.33180), (1.5, 0.50263), (2.0, 0.79639)])
@pytest.mark.parametrize("bend", ["auto", "off"])
def test_a_limp_cable_hangs_as_a_catenary(ratio, sag, bend):
    d = 1.0 / ratio
    half = brentq(lambda x: np.sin(x) / x - d, 1e-6, np.pi - 1e-6)
    hanging = Scene(
        cable=cable(bending_stiffness=1e-7, axial_stiffness=1e5),
        shape=Points(points=hanging_arc(2 * half)),
        grasps=(Grasp(u=0.0), Grasp(u=1.0)),
        effects={"bend": bend},
        horizon=1.0,
    )
    lowest = equilibrium(hanging).positions(0.5)[0, 2]
    # EI 1e-7 stiffens the ends by a length sqrt(EI/T) of 1e-3 m; five digits in the table
    assert -lowest / d == pytest.approx(sag, abs=3e-4)


@pytest.mark.parametrize("stiffness", [1e-6, 1e-5])
def test_a_limp_cable_that_is_held_level_bends_down_within_a_few_millimetres(stiffness):
    """EI phi'' = T sin phi from the level to the vertical, far from its end: it hangs sqrt(2 EI/T) from the grasp."""
    held = Scene(
        cable=cable(bending_stiffness=stiffness, axial_stiffness=1e3),
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        horizon=1.0,
    )
    found = equilibrium(held)
    assert found.status == "converged", found.message
    tension = held.cable.linear_density * 9.81
    assert found.positions([1.0])[0, 0] == pytest.approx(np.sqrt(2.0 * stiffness / tension), abs=1e-4)


def elastica_column(shortening: float) -> tuple[float, float]:
    """Return the modulus k and P L^2/EI of a pinned column whose ends have approached by `shortening` L."""
    k = np.sqrt(brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - (1 - shortening), 1e-9, 0.9))
    return k, 4 * ellipk(k * k) ** 2


def bow(amplitude: float) -> ControlPoints:
    """Return a cable along x that bows to the side and ends along x."""
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, 11), np.ones(3)])
    x = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3
    side = 0.5 * (1 - np.cos(2 * np.pi * x))
    side[[1, -2]] = 0.0  # along x where a gripper may hold the direction
    return ControlPoints(control_points=np.column_stack([x, amplitude * side, 0 * x]), knots=knots)


def leaning(up: int, side: int) -> ControlPoints:
    """Return a cable from the origin along one axis, bent towards another: by 0.02 L at the tip."""
    control = np.zeros((4, 3))
    control[:, up] = np.linspace(0.0, 1.0, 4)
    control[2:, side] = [0.02 / 3, 0.02]
    return ControlPoints(control_points=control)


@pytest.mark.parametrize("shortening", [0.003, 0.1, 0.5])
@pytest.mark.parametrize(("hold", "factor"), [("point", 1.0), ("tangent", 4.0)])
def test_a_compressed_column_pushes_with_the_load_of_the_buckled_elastica(hold, factor, shortening):
    # pinned: pi^2 EI/L^2 at first; built in at both ends: four times as much, being two halves of two quarters
    push = Move(displacement=(-shortening, 0.0, 0.0), duration=1.0)
    grasps = (Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=push))
    # on a table: in space, the one whose directions are held leaves its plane before its ends are half as far apart
    around = replace(WEIGHTLESS, gravity=(0.0, 0.0, -9.81), table=Table())
    scene = Scene(cable=cable(axial_stiffness=1e4), shape=bow(1e-2), grasps=grasps, environment=around)
    found = equilibrium(scene, at=1.0)
    assert found.status == "converged"
    _, load = elastica_column(shortening)
    # the answer is refined to 1e-4 L
    np.testing.assert_allclose(found.reactions[1], [-factor * load * EI, 0.0, 0.0], atol=2e-3 * factor * load * EI)


def test_euler_load_of_a_free_standing_column_lies_between_standing_and_falling():
    def lean(load: float) -> float:
        scene = Scene(
            cable=cable(axial_stiffness=1e4),
            shape=leaning(0, 1),
            grasps=(CLAMPED,),
            loads=(Load(u=1.0, force=(-load * EI, 0.0, 0.0)),),
            environment=WEIGHTLESS,
            horizon=1.0,
        )
        return abs(equilibrium(scene).positions(1.0)[0, 1])

    assert lean(0.99 * 2.4674) < 1e-6
    # sideways tip of the elastica: 2 k L/K(k) with K(k)^2 = P L^2/EI
    k = brentq(lambda k: ellipk(k * k) ** 2 - 1.05 * 2.4674, 1e-3, 0.9)
    assert lean(1.05 * 2.4674) == pytest.approx(2 * k / ellipk(k * k), abs=1e-3)  # steep in the load: 0.06 a percent


def test_self_weight_buckling_lies_between_standing_and_falling():
    # q L^3/EI = 7.83735 (Greenhill)
    def lean(q: float) -> float:
        scene = Scene(
            cable=cable(linear_density=q * EI / G, axial_stiffness=1e4),
            shape=leaning(2, 0),
            grasps=(CLAMPED,),
            horizon=1.0,
        )
        return abs(equilibrium(scene).positions(1.0)[0, 0])

    assert lean(0.99 * 7.83735) < 1e-6
    assert lean(1.01 * 7.83735) > 0.1


def hanging_with_load(hold: str) -> Scene:
    lifted = Move(displacement=(-0.05, 0.2, 0.1), duration=1.0)
    return Scene(
        cable=cable(),
        shape=Points(points=hanging_arc(2.4)),
        grasps=(Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=lifted)),
        loads=(Load(u=0.3, force=(0.1, -0.05, -0.2)),),
    )


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_reactions_balance_weight_and_loads(hold):
    scene = hanging_with_load(hold)
    found = equilibrium(scene, at=1.0, n_u=17)
    load = np.array([0.1, -0.05, -0.2])
    weight = np.array([0.0, 0.0, -MU * G])
    # the last Newton step is below 1e-10 m, times the axial stiffness of a span, EA/h = 1e4 N/m
    np.testing.assert_allclose(found.reactions.sum(axis=0) + load + weight, 0.0, atol=1e-6)
    u, w = np.polynomial.legendre.leggauss(4)
    cuts = np.unique(found.knots_u)
    half = 0.5 * np.diff(cuts)[:, None]
    r = found.positions((cuts[:-1, None] + half * (1 + u)).ravel())
    moment = np.cross(found.positions([0.0, 1.0]), found.reactions).sum(axis=0) + found.moments.sum(axis=0)
    moment += np.cross(found.positions(0.3)[0], load) + np.cross((half * w).ravel() @ r, weight)
    np.testing.assert_allclose(moment, 0.0, atol=1e-6)


def test_statics_do_not_depend_on_mass_where_there_is_no_weight():
    def tip(density: float) -> np.ndarray:
        light = Cable(length=1.0, diameter=0.005, linear_density=density, bending_stiffness=EI)
        load = Load(u=1.0, force=(0.0, 2e-3, 0.0))
        scene = Scene(
            cable=light, shape=Straight(), grasps=(CLAMPED,), loads=(load,), environment=WEIGHTLESS, horizon=1
        )
        return equilibrium(scene, n_u=13).positions(1.0)

    np.testing.assert_array_equal(tip(0.01), tip(1.0))


def test_a_cable_held_by_nothing_has_no_equilibrium_under_its_weight():
    with pytest.raises(ValueError, match="primitives"):
        equilibrium(Scene(cable=cable(), shape=Straight(), environment=Environment(), horizon=1.0))


@pytest.mark.parametrize("hold", ["point", "tangent"])
@pytest.mark.parametrize("target", [None, 2e-5])
def test_an_equilibrium_tells_of_errors_in_its_end_spans(hold: str, target: float | None) -> None:
    # z = -u - w (L u - u^2/2)/EA, whose error is in the span at the grip, and falls with its length only: at 65 even
    # places, and as far as two grids tell, it had been up to nine times less than it is
    EA = 20.0
    scene = Scene(
        cable=cable(axial_stiffness=EA),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, hold=hold),),
        horizon=1.0,
        quality=Quality(target_error=target),
    )
    found = equilibrium(scene)
    u = np.linspace(0.0, 1.0, 4001)
    off = np.abs(found.positions(u)[:, 2] + u + 0.05 * 9.81 * (u - 0.5 * u**2) / EA).max()
    assert found.error_estimate is not None
    assert off < 1.2 * found.error_estimate


def test_a_column_that_buckles_ends_where_it_would_without_the_bow_that_made_it() -> None:
    # 1.03 times as heavy as it bears, mu g L^3/EI = 7.8373 of Greenhill: theta'' = -mu g/EI (L - u) sin theta from the
    # vertical, solved as a boundary value problem; with the bow of 1 mm its tip had been 14 mm off
    heavy = cable(bending_stiffness=MU * G / 7.8373 / 1.03, axial_stiffness=1e5)
    scene = Scene(cable=heavy, shape=Straight(direction=(0.0, 0.0, 1.0)), grasps=(CLAMPED,), horizon=1.0)
    tip = equilibrium(scene).positions([1.0])[0]
    np.testing.assert_allclose([np.hypot(tip[0], tip[1]), tip[2]], [0.35398, 0.92291], atol=5e-4)


@pytest.mark.parametrize("closer", [0.05, 0.3])
def test_a_cable_whose_ends_come_closer_is_an_elastica_to_what_two_grids_tell(closer: float) -> None:
    # as high as k/K(k), in parts of its length; it had been up to 0.19 mm off as it kept its bow
    nearer = Grasp(u=1.0, path=Move(displacement=(-closer, 0.0, 0.0), duration=1.0))
    scene = Scene(
        cable=cable(axial_stiffness=1e5),
        shape=Straight(),
        grasps=(Grasp(u=0.0), nearer),
        environment=WEIGHTLESS,
        horizon=1.0,
    )
    found = equilibrium(scene, at=1.0)
    assert "has no side to buckle to" in found.message
    height = float(np.linalg.norm(found.positions([0.5])[0, 1:]))
    assert found.error_estimate is not None
    k, _ = elastica_column(closer)
    assert height == pytest.approx(k / ellipk(k * k), abs=found.error_estimate)


def test_an_equilibrium_tells_how_far_forces_and_moments_may_be_off() -> None:
    # between two clamps, a limp cable: its moment there is of a boundary layer, and 7 % off where positions are not
    nearer = Grasp(u=1.0, hold="tangent", path=Move(displacement=(-0.1, 0.0, 0.0), duration=1.0))
    opened = Grasp(u=0.5, release_time=0.5)
    scene = Scene(cable=cable(bending_stiffness=1e-5), shape=Straight(), grasps=(CLAMPED, nearer, opened), horizon=1.0)
    found, exact = equilibrium(scene, at=1.0), equilibrium(scene, at=1.0, n_u=257)
    assert exact.reaction_errors is None
    assert exact.moment_errors is None
    for name in ("reaction", "moment"):
        off = np.linalg.norm(getattr(found, f"{name}s") - getattr(exact, f"{name}s"), axis=1)
        told = getattr(found, f"{name}_errors")
        assert (off <= told).all()
        assert (told[:2] < 0.1 * np.linalg.norm(getattr(exact, f"{name}s")[:2], axis=1)).all()
        assert told[2] == 0.0


@pytest.mark.parametrize(("gap", "stiffness", "moment"), [(0.98, 1e-6, 2.91144e-4), (0.9996, 1e-4, 1.12794e-3)])
def test_an_equilibrium_tells_of_moments_on_which_grids_agree_by_chance(gap, stiffness, moment) -> None:
    # a cable of EA 1e5 N between two level clamps; EI theta'' and its tension solved as a boundary value problem. At
    # the clamps it bends within sqrt(EI/T), less than a span: the moment is 5 % off, and grids agreed to 0.1 and 1 %
    nearer = Grasp(u=1.0, hold="tangent", path=Move(displacement=(gap - 1.0, 0.0, 0.0), duration=1.0))
    limp = cable(bending_stiffness=stiffness, axial_stiffness=1e5)
    found = equilibrium(Scene(cable=limp, shape=Straight(), grasps=(CLAMPED, nearer), horizon=1.0), at=1.0)
    assert found.moment_errors is not None
    off = np.abs(np.abs(found.moments[:, 1]) - moment)
    assert (off <= found.moment_errors).all()
    assert (found.moment_errors < 0.15 * moment).all()


@pytest.mark.parametrize(("hold", "factor", "share"), [("point", 24.0, 1 / 2), ("tangent", 72.0, 2 / 3)])
def test_an_end_that_is_lifted_from_a_table_carries_what_beam_theory_says(hold, factor, share):
    # EI y'''' = -mu g above the table, y = y' = y'' = 0 where the cable leaves it: the length l^4 = factor EI h/(mu g)
    # is in the air, and the rest of its weight bears on the table there
    height, stiffness = 0.01, 1e-2
    lifted = Grasp(u=0.0, hold=hold, path=Move(displacement=(0.0, 0.0, height), duration=1.0))
    heavy = cable(length=2.0, bending_stiffness=stiffness, axial_stiffness=1e6)
    around = Environment(table=Table())
    found = equilibrium(Scene(cable=heavy, shape=Straight(), grasps=(lifted,), environment=around, horizon=1), at=1.0)
    weight = MU * G
    free = (factor * stiffness * height / weight) ** 0.25
    touch = (1.0 - share) * weight * free  # the force of the table at the point where the cable leaves it
    u = np.linspace(0.0, 2.0, 201)
    up = np.maximum(free - u, 0.0)
    exact = (touch * up**3 / 6 - weight * up**4 / 24) / stiffness
    np.testing.assert_allclose(found.positions(u)[:, 2], exact, atol=5e-5)  # the cable sinks in by 2e-5 at that point
    assert found.reaction_errors is not None
    assert found.reactions[0, 2] == pytest.approx(share * weight * free, rel=5e-3)
    assert found.moments[0, 1] == pytest.approx(touch * free - weight * free**2 / 2, rel=5e-3, abs=1e-12)


def test_a_stiff_cable_on_three_supports_loads_them_as_a_continuous_beam():
    stiff = cable(length=2.0, bending_stiffness=5.0, axial_stiffness=1e3)
    found = equilibrium(Scene(cable=stiff, shape=Straight(), grasps=tuple(Grasp(u=u) for u in (0, 1, 2)), horizon=1.0))
    np.testing.assert_allclose(found.reactions[:, 2], np.array([3 / 16, 5 / 8, 3 / 16]) * 2 * MU * G, rtol=1e-5)


def helix(radius: float, pitch: float, length: float, twist: float, n: int) -> tuple[ControlPoints, np.ndarray]:
    """Return a helix about z, its sections twisted by `twist` [rad/m], and its unit tangents (n, 3)."""
    u = np.linspace(0.0, length, n)
    phi = u * np.cos(pitch) / radius
    r = np.column_stack([radius * np.cos(phi), radius * np.sin(phi), u * np.sin(pitch), twist * u])
    spline = make_interp_spline(u, r, k=3)
    tangents = np.column_stack([-np.sin(phi), np.cos(phi), 0 * phi]) * np.cos(pitch) + [0.0, 0.0, np.sin(pitch)]
    return ControlPoints(control_points=spline.c, knots=spline.t), tangents


def test_a_rod_is_held_in_a_helix_by_the_wrench_of_kirchhoff():
    # M = EI kappa b + GJ tau t, and a force along the axis: GJ tau cos a/R - EI cos^2 a sin a/R^2 (Love, art. 270)
    R, a, bend, GJ, tau = 0.1, np.radians(40), 1e-2, 7e-3, 2.0
    length = 0.6 * 2 * np.pi * R / np.cos(a)
    shape, tangents = helix(R, a, length, tau, 81)
    rod = cable(length=length, bending_stiffness=bend, torsional_stiffness=GJ, axial_stiffness=1e5)
    ends = (Grasp(u=0.0, hold="clamp"), Grasp(u=length, hold="clamp"))
    found = equilibrium(Scene(cable=rod, shape=shape, grasps=ends, environment=WEIGHTLESS, horizon=1.0))
    assert found.error_estimate is not None
    end = np.array([R * np.cos(1.2 * np.pi), R * np.sin(1.2 * np.pi), length * np.sin(a)])
    normal = -end * [1, 1, 0] / R
    moment = bend * np.cos(a) ** 2 / R * np.cross(tangents[-1], normal) + GJ * tau * tangents[-1]
    force = GJ * tau * np.cos(a) / R - bend * np.cos(a) ** 2 * np.sin(a) / R**2
    np.testing.assert_allclose(found.reactions[1], [0.0, 0.0, force], atol=1e-3 * abs(force))
    np.testing.assert_allclose(found.moments[1], moment, atol=1e-3 * np.linalg.norm(moment))
    energy = length / 2 * (bend * (np.cos(a) ** 2 / R) ** 2 + GJ * tau**2)
    assert found.energy == pytest.approx(energy, rel=1e-4)


def test_a_coil_spring_is_as_stiff_as_the_torsion_of_its_wire():
    # a close coil: k = GJ/(2 pi n R^3); with a pitch of 4 degrees and clamps that do not turn, by Castigliano
    R, a, n, bend, GJ, longer = 0.02, np.radians(4), 4, 1e-3, 8e-4, 5e-4
    length = 2 * np.pi * R * n / np.cos(a)
    shape, tangents = helix(R, a, length, 0.0, 40 * n + 1)
    u = np.linspace(0.0, length, 40 * n + 1)
    phi = u * np.cos(a) / R
    arm = np.array([R, 0.0, length * np.sin(a)]) - np.column_stack([R * np.cos(phi), R * np.sin(phi), u * np.sin(a)])
    of_force = np.cross(arm[:, None, :], np.eye(3)[None])  # moments of unit forces at the end, and unit moments
    moments = np.concatenate([of_force, np.broadcast_to(np.eye(3), of_force.shape)], axis=1)
    along = np.einsum("uid,ud->ui", moments, tangents)
    product = np.einsum("uid,ujd->uij", moments, moments)
    twisted = along[:, :, None] * along[:, None, :]
    compliance = simpson((product - twisted) / bend + twisted / GJ, x=u, axis=0)
    stiffness = np.linalg.inv(compliance)[2, 2]
    assert stiffness == pytest.approx(GJ / (2 * np.pi * n * R**3), rel=0.01)
    wire = Cable(
        length=length, diameter=0.001, linear_density=0.01, bending_stiffness=bend, torsional_stiffness=GJ,
        axial_stiffness=1e6, rest_shape="initial",
    )  # fmt: skip
    pulled = Grasp(u=length, hold="clamp", path=Move(displacement=(0.0, 0.0, longer), duration=1.0))
    grasps = (Grasp(u=0.0, hold="clamp"), pulled)
    found = equilibrium(Scene(cable=wire, shape=shape, grasps=grasps, environment=WEIGHTLESS, horizon=1.0), at=1.0)
    assert found.reactions[1, 2] == pytest.approx(stiffness * longer, rel=1e-3)


def test_a_time_limit_that_passes_on_a_finer_grid_is_told():
    scene = Scene(cable=cable(), shape=Straight(), grasps=(CLAMPED,), horizon=1)
    asked = []
    equilibrium(scene, n_u=9, cancelled=lambda: bool(asked.append(1)))
    first = len(asked)

    def late():
        asked.append(1)
        if len(asked) == 2 * first + 2:  # on the second or third grid
            time.sleep(0.6)
        return False

    found = equilibrium(scene, deadline=0.5, cancelled=late)
    assert found.status == "time_limit"  # it had been max_iterations, as of the finest grid
    assert found.message.startswith("The time limit passed")

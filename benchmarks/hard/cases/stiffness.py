"""Hard stiffnesses, densities and dampings."""

from dataclasses import replace

import numpy as np

from benchmarks.hard import curves
from benchmarks.hard.cases.base import WEIGHTLESS, apart, at_end, case, cord, move, samples
from benchmarks.hard.laws import energy_gain
from dlocore import Environment, Grasp, Load, Points, Prediction, Scene, Straight, predict

AROUND = Environment(drag=0.1)


CRACKS = 0.5  # [s]: by then the free end has fallen, and has whipped


def _sidewise(horizon: float | None = None, **cable: float) -> Scene:
    grasps = (Grasp(u=0.25, path=move(0.1, 0.3, 0.1)),)
    return Scene(cable=cord(**cable), shape=Straight(), grasps=grasps, environment=AROUND, horizon=horizon)


@case("stiffness", "all laws")
def bending_stiffness_of_1e_minus_6() -> Scene:
    """EI/(mu g L^3) = 2e-6: bends are as sharp as the grid resolves, and the free end whips."""
    return _sidewise(CRACKS, bending_stiffness=1e-6, axial_stiffness=640.0)


def _rigid(p: Prediction) -> float:
    u, t = samples(p)
    r = p.surface.positions(u, t)
    start = np.column_stack([u, 0 * u, 0 * u])
    return float(np.linalg.norm(r - (start + (r[:, :1] - start[:1])), axis=-1).max())


@case("stiffness", "a rigid body that follows its gripper", error=_rigid, within=2e-3)
def bending_stiffness_of_4() -> Scene:
    """EI/(mu g L^3) = 8: bending waves cross the cable within milliseconds of a motion of a second."""
    grasps = (Grasp(u=0.25, hold="tangent", path=move(0.1, 0.3, 0.1)),)
    cable = cord(bending_stiffness=4.0, bending_damping=0.01, linear_density=0.01, axial_stiffness=1e6)
    return Scene(cable=cable, shape=Straight(), grasps=grasps, environment=replace(WEIGHTLESS, drag=0.01))


@case("stiffness", "all laws")
def light_cable() -> Scene:
    """0.01 kg/m at the usual stiffness: fast waves."""
    return _sidewise(linear_density=0.01)


@case("stiffness", "all laws")
def heavy_cable() -> Scene:
    """1 kg/m at the usual stiffness: EI/(mu g L^3) = 1e-4."""
    return _sidewise(CRACKS, linear_density=1.0, axial_stiffness=4e3)


def _from_softer(p: Prediction) -> float:
    softer = replace(p.scene.cable, axial_stiffness=1e-2 * float(p.scene.cable.axial_stiffness or 0.0))
    return apart(p, predict(replace(p.scene, cable=softer)))


@case("stiffness", "that of EA L^2/EI = 1e7: nothing stretches in either", error=_from_softer)
def axial_stiffness_of_1e9() -> Scene:
    """EA L^2/EI = 1e9: membrane locking, and tangents with a condition of 1e12."""
    return _sidewise(bending_stiffness=1e-3, axial_stiffness=1e6)


def _hangs(p: Prediction) -> float:
    """Return the difference of the end's sag from the exact one of a hanging bar with a load, of that sag."""
    cable = p.scene.cable
    EA, weight = float(cable.axial_stiffness or 0.0), cable.linear_density * 9.81
    exact = (weight * 0.5 + 20.0) / EA
    sag = -at_end(p, [1.0])[0, 2] - 1.0
    return float(abs(sag / exact - 1.0))


@case("stiffness", "the end hangs lower by (mu g L^2/2 + F L)/EA", error=_hangs, within=1e-2)
def true_stretch_of_a_hanging_cable() -> Scene:
    """The strain itself is asked for: 1e-3, under a load that rises within the motion."""
    load = Load(u=1.0, force=[[0, 0, 0], [0, 0, -20.0], [0, 0, -20.0]], times=[0.0, 1.0, 2.0])
    cable = cord(axial_stiffness=2e4)
    shape = Straight(direction=(0, 0, -1), settle=True)
    return Scene(cable=cable, shape=shape, grasps=(Grasp(u=0.0),), loads=(load,), environment=Environment(drag=2.0))


def _clamped(ratio: float) -> Scene:
    points = curves.arc(1.0, 0.8, "flat")
    turn = move(-0.05, 0, 0, rotation=(0.8, 0, 0))
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=turn))
    cable = cord(torsional_stiffness=ratio * 1e-3, rest_shape="initial")
    return Scene(cable=cable, shape=Points(points=points), grasps=grasps, environment=replace(WEIGHTLESS, drag=0.1))


@case("stiffness", "all laws")
def torsion_a_hundredth_of_bending() -> Scene:
    """GJ/EI = 0.01: twist costs nothing, and its equations are nearly singular."""
    return _clamped(0.01)


@case("stiffness", "all laws")
def torsion_a_hundred_times_bending() -> Scene:
    """GJ/EI = 100: the cable bends rather than twists."""
    return _clamped(100.0)


def _lost_energy(p: Prediction) -> float:
    """Return the energy that is gained, or lost beyond the little that the scheme damps, of that of the swing."""
    t = np.linspace(0.0, p.surface.horizon, 33)
    parts = p.energies(t)
    lost = float(-sum(x[-1] - x[0] for x in parts.values())) / float(parts["kinetic"].max())
    return max(float(energy_gain(p) or 0.0), lost - 0.05)


@case(
    "stiffness", "energy stays, but for the 5 % of short waves that the scheme damps", error=_lost_energy, within=0.02
)
def no_damping_at_all() -> Scene:
    """Nothing takes energy out: what the scheme adds stays and grows."""
    cable = cord(bending_stiffness=3e-2)
    return Scene(cable=cable, shape=Straight(), grasps=(Grasp(u=0.0),), environment=Environment(), horizon=1.0)


@case("stiffness", "all laws")
def heavy_damping() -> Scene:
    """Drag stops the cable within a hundredth of the motion, and bending creeps: stiff equations."""
    grasps = (Grasp(u=0.5, path=move(0.1, 0.3, 0.1)),)
    cable = cord(bending_damping=1e-3)
    return Scene(cable=cable, shape=Straight(), grasps=grasps, environment=replace(WEIGHTLESS, drag=5.0))

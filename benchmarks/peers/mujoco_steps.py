"""Models and time steps that MuJoCo's chain and its flex share."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.peers.cases import SAMPLES_T
from benchmarks.peers.frame import Floats, Frame, transported
from dlocore import Grasp

COUNTS = (4, 5, 6, 8, 10, 12, 16, 20, 24, 30, 40, 60, 80, 120)
STEPS = (1, 2, 3, 4, 6, 8, 11, 16, 22, 32, 45, 64, 90, 128, 180, 256, 360, 512, 720, 1024)
HEAVY = 1e4  # [kg]: what follows a path is not moved by the cable
_WARNINGS: list[str] = []  # MuJoCo calls back from C, where nothing can be raised
GATE = 1e-6  # [s]: velocities of the followed paths are differences over this


def document(frame: Frame, *, integrator: str, viscosity: float, bodies: str, rest: str) -> str:
    """Return the MJCF of a model: no contacts, no sleeping, a Newton solver that goes to rounding."""
    return (
        f'<mujoco><option timestep="{frame.dt:.17g}" integrator="{integrator}" viscosity="{viscosity:.12g}" '
        'solver="Newton" tolerance="1e-12"><flag contact="disable" autoreset="disable"/></option>'
        '<compiler autolimits="true" boundmass="0" boundinertia="0"/>'
        f"<worldbody>{bodies}</worldbody>{rest}</mujoco>"
    )


def carriage(grasp: Grasp) -> str:
    """Return a body so heavy that the cable does not move it, whose position and velocity are written every step."""
    turn = '<joint type="ball"/>' if grasp.hold == "clamp" else ""
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    return (
        f'<body name="carriage" gravcomp="1">{slides}{turn}<inertial pos="0 0 0" mass="{HEAVY:g}" '
        f'diaginertia="{HEAVY:g} {HEAVY:g} {HEAVY:g}"/><site name="carriage"/></body>'
    )


def load(text: str) -> tuple[Any, Any]:
    """Return the compiled model and its data; MuJoCo's warnings are kept for `advance`."""
    import mujoco

    mujoco.set_mju_user_warning(_warned)
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


@dataclass(frozen=True)
class Followers:
    """Where the carriage of a followed grasp has its coordinates, and what they are at every step."""

    position: slice
    velocity: slice
    q: Floats
    v: Floats

    @staticmethod
    def of(model: Any, frame: Frame) -> "Followers | None":
        """Return the carriage's coordinates at the start of every step; None where no grasp is followed."""
        if not frame.followed:
            return None
        grasp, node = frame.followed[0]
        body = model.body("carriage").id
        q, v = int(model.jnt_qposadr[model.body_jntadr[body]]), int(model.body_dofadr[body])
        t = np.arange(len(frame.gravity)) * frame.dt
        near = [grasp.path.at(t + s, frame.start.positions[node]) for s in (-GATE, 0.0, GATE)]
        root = -np.cumsum(np.vstack([np.zeros(3), frame.wind[:-1]]) * frame.dt, axis=0)
        columns = [near[1] - frame.origin[0] - root]
        rates = [(near[2] - near[0]) / (2.0 * GATE) + frame.wind]
        turns = grasp.path.rotation_at(t)
        if grasp.hold == "clamp":
            start = transported(frame)[-1]
            turned = start if turns is None else Rotation.from_matrix(turns) * start
            columns.append(np.broadcast_to(turned.as_quat()[..., [3, 0, 1, 2]], (len(t), 4)))
            spin = np.zeros((len(t), 3))
            if turns is not None:
                ahead, behind = grasp.path.rotation_at(t + GATE), grasp.path.rotation_at(t - GATE)
                assert ahead is not None
                assert behind is not None
                world = Rotation.from_matrix(ahead @ behind.transpose(0, 2, 1)).as_rotvec() / (2.0 * GATE)
                spin = turned.inv().apply(world)
            rates.append(spin)
        wide_q, wide_v = np.concatenate(columns, axis=1), np.concatenate(rates, axis=1)
        return Followers(slice(q, q + wide_q.shape[1]), slice(v, v + wide_v.shape[1]), wide_q, wide_v)


def _warned(text: str) -> None:
    _WARNINGS.append(text)


class Recorder(Protocol):
    """Keeps what a peer needs of the state at the samples."""

    def keep(self, sample: int) -> None:
        """Store the present state as that of a sample."""

    def result(self) -> Any:
        """Return what was stored."""


def advance(model: Any, data: Any, frame: Frame, followers: Followers | None, recorder: Recorder) -> Any:
    """Step through the motion; what the recorder kept.

    Raises:
        FloatingPointError: MuJoCo warned, mostly that the simulation is unstable.
    """
    import mujoco

    step, option, gravity, wind = mujoco.mj_step, model.opt, frame.gravity, frame.wind
    felt, blown = option.gravity, option.wind
    _WARNINGS.clear()
    mujoco.mj_kinematics(model, data)
    recorder.keep(0)
    k = 0
    for sample in range(1, SAMPLES_T):
        for _ in range(frame.steps):
            felt[:] = gravity[k]
            blown[:] = wind[k]
            if followers is not None:
                data.qpos[followers.position] = followers.q[k]
                data.qvel[followers.velocity] = followers.v[k]
            step(model, data)
            k += 1
            if _WARNINGS:
                raise FloatingPointError(_WARNINGS.pop())
        mujoco.mj_kinematics(model, data)
        recorder.keep(sample)
    return recorder.result()

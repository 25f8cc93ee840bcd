"""Compile every kernel, or load it from the cache, by making predictions that together use all of them."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from dlocore.compiling.caching import is_kept
from dlocore.compiling.interrupts import interruptible
from dlocore.errors import Cancelled, whole
from dlocore.front import predict
from dlocore.kernels.march import march_steps
from dlocore.machine import usable_cores
from dlocore.prediction import Prediction
from dlocore.problem.problem import pose
from dlocore.problem.strands import nearest_strands
from dlocore.scene.cable import Cable
from dlocore.scene.obstacles import Sphere
from dlocore.scene.paths import Move
from dlocore.scene.scene import Environment, Grasp, Points, Quality, Scene, Straight, Switch, Table
from dlocore.sensitivity import sensitivities
from dlocore.spline import uniform_knots
from dlocore.statics.statics import equilibrium

_MOST_PROCESSES = 1024
U = np.linspace(0.0, 1.0, 12)[:, None]
ARC = Points(points=U * [1.0, 0.0, 0.0] + 0.05 * np.sin(3.0 * U) * [0.0, 1.0, 0.0])
MOVE = Move(displacement=(0.0, 0.01, 0.0), rotation=(0.0, 0.0, 0.1), duration=1.0)
GRASP = Grasp(u=0.3, hold="clamp", path=MOVE)
# it yields at a curvature that it never reaches, and has a memory: so the code for yielding is compiled, too
CABLE = Cable.preset("paper", bending_damping=1e-4, yield_strain=0.1, memory_rate=1.0)


def is_compiled() -> bool:
    """Return whether the kernels have been compiled before: loading them takes seconds, compiling them minutes."""
    return is_kept(march_steps)


@interruptible
def warm_up(processes: int | None = None, cancelled: Callable[[], bool] | None = None) -> None:
    """Compile, or load from the cache, every kernel, so that the first prediction is as fast as the next.

    Args:
        processes: how many processes compile at once if nothing is compiled yet, 1 to 1024; by default one for each
            core that this process may use.
        cancelled: called ten times a second while they compile, and between the parts that are loaded; the warm-up
            stops if it returns True.

    Raises:
        SceneError: `processes` is not such a number.
        Cancelled: `cancelled` returned True.
    """
    if processes is not None:
        processes = whole("processes", processes, at_least=1, at_most=_MOST_PROCESSES)

    def check() -> None:
        if cancelled is not None and cancelled():
            raise Cancelled("the warm-up was cancelled")

    by_python = Path(sys.executable or "").name.startswith("python")  # not a program that embeds Python
    if by_python and not is_compiled():
        _compile_in_processes(processes or usable_cores(), check)
    for part in PARTS.values():
        check()
        part()


@interruptible
def warm_up_for(scene: Scene) -> None:
    """Load the kernels that a prediction of one scene needs; if nothing is compiled yet, compile all.

    If the motion leaves its plane, or turns out to need another effect, the kernels for that are loaded then.

    Raises:
        SceneError: the scene can't be solved as it was given.
    """
    if not is_compiled():
        warm_up()
        return
    for name in TAKEN[pose(scene).nc]:
        PARTS[name]()
    if scene.quality.method == "reference":
        PARTS["reference"]()


def _compile_in_processes(at_once: int, check: Callable[[], None]) -> None:
    """Compile every share in a process of its own; what a process fails to compile is left to the caller.

    After a process is killed no other is started. All are killed if `check` raises. They also end when this process
    ends, however it does, because each reads from a pipe that this one holds. An interrupt from a terminal reaches this
    process only.
    """
    waiting, running = list(SHARES), list[subprocess.Popen[bytes]]()
    nowhere = subprocess.DEVNULL
    try:
        while waiting or running:
            check()
            while waiting and len(running) < at_once:
                command = [sys.executable, "-m", "dlocore.warming", *waiting.pop(0)]
                running.append(
                    subprocess.Popen(
                        command, stdin=subprocess.PIPE, stdout=nowhere, stderr=nowhere, start_new_session=True
                    )
                )
            time.sleep(0.1)
            for process in [process for process in running if process.poll() is not None]:
                running.remove(process)
                process.communicate()
                if process.returncode < 0:
                    waiting.clear()
    finally:
        for process in running:
            process.kill()
            process.communicate()


def _end_with_parent() -> None:
    """End this process once its parent has ended, which closes the pipe that is read here."""
    os.read(0, 1)
    os._exit(1)


def _smooth(table: Table | None) -> None:
    """Predict a whole smooth motion."""
    around = Environment(drag=0.1, table=table)
    predict(Scene(cable=Cable.preset("paper"), shape=ARC, grasps=(GRASP,), environment=around))


def _differentiated(table: Table | None, twist: Switch) -> None:
    """Differentiate a smooth motion of two, three or four coordinates; `identify` needs that, too."""
    scene = Scene(
        cable=Cable.preset("paper"),
        shape=ARC,
        grasps=(GRASP,),
        environment=Environment(drag=0.1, table=table),
        effects={"twist": twist},
        quality=Quality(n_u=9, n_t=9, keep_grid=True),
    )
    sensitivities(predict(scene), ["cable.bending_stiffness"])


def _rough(table: Table | None, twist: Switch) -> None:
    """Predict motions of two, three or four coordinates that start with a jump of speed, rub, touch and may yield."""
    beside = (Sphere(center=(0.5, 0.3, 0.0), radius=0.2, friction=0.1),)
    environment = Environment(drag=0.1, drag_quadratic=0.1, table=table, obstacles=beside)
    given = Quality(n_u=9, n_t=9, keep_grid=True)
    for quality in (Quality(), given, replace(given, method="spacetime")):
        plastic: Switch = "on" if quality.method == "auto" and twist != "off" else "off"
        scene = Scene(
            cable=CABLE,
            shape=replace(ARC, settle=table is None),
            grasps=(replace(GRASP, path=replace(MOVE, profile="linear")),),
            environment=environment,
            effects={"twist": twist, "plasticity": plastic},
            quality=quality,
        )
        for effects in (scene.effects, {"twist": twist, "obstacles": "off"}):
            _read_all(predict(replace(scene, effects=effects)))
    equilibrium(scene, n_u=9)


def _read_all(answer: Prediction) -> None:
    """Read the energies and every attribute that is computed on first read, so that their kernels are compiled, too."""
    _ = answer.message, answer.grasps, answer.contacts, answer.effects, answer.material, answer.start_energy
    _ = [(iteration.surface, iteration.energy) for iteration in answer.iterations]
    answer.energies([0.0])


def _reference() -> None:
    """Solve by the reference, and find strands that meet."""
    turned = np.linspace(0.0, 7.0, 9)
    loop = np.column_stack([np.cos(turned), np.sin(turned), 0.1 * U[:9, 0]])
    nearest_strands(uniform_knots(9, 1.0), loop[None], 3, 0.01, 0.03)
    still = Environment(gravity=(0.0, 0.0, 0.0))
    by_reference = Quality(method="reference", target_error=1.0)
    settled = Scene(cable=CABLE, shape=replace(ARC, settle=True), environment=still, horizon=1e-3, quality=by_reference)
    _read_all(predict(settled))


def _others() -> None:
    """Find an equilibrium in a plane without contact, and solve by the printed scheme."""
    hangs = Scene(cable=CABLE, shape=Straight(direction=(0.0, 0.0, -1.0)), grasps=(Grasp(u=0.0),), horizon=1.0)
    equilibrium(hangs, n_u=9)
    as_printed = Quality(n_u=6, n_t=6, method="paper", delta=0.01, keep_grid=True)
    predict(Scene(cable=CABLE, shape=ARC, grasps=(GRASP,), environment=Environment(table=Table()), quality=as_printed))


# whole smooth motions first: the copy of a function that is loaded first serves all its callers, and these motions run
# faster with the copy that was compiled for them
PARTS = {
    "smooth in a plane": lambda: _smooth(Table()),
    "smooth in space": lambda: _smooth(None),
    "in a plane": lambda: _rough(Table(friction=0.1), "auto"),
    "in space": lambda: _rough(None, "off"),
    "with twist": lambda: _rough(None, "on"),
    "derivatives in a plane": lambda: _differentiated(Table(), "auto"),
    "derivatives in space": lambda: _differentiated(None, "off"),
    "derivatives with twist": lambda: _differentiated(None, "on"),
    "reference": _reference,
    "others": _others,
}
# parts that motions of two, three and four coordinates need
TAKEN = {
    2: ("smooth in a plane", "in a plane"),
    3: ("smooth in space", "in space"),
    4: ("smooth in space", "with twist"),
}
# what each process compiles, the longest first. What the last one shares with the one before it comes last, so that it
# is compiled by then
SHARES = (
    ("with twist", "derivatives with twist"),
    ("smooth in space", "in space", "derivatives in space"),
    ("smooth in a plane", "in a plane"),
    ("reference", "others", "derivatives in a plane"),
)

if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for name in sys.argv[1:]:
        PARTS[name]()

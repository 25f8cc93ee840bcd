"""Cancelling, deadlines, and what a prediction says about itself."""

import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dlocore import Cancelled, Grasp, Iteration, Load, Move, Quality, Scene, Straight, equilibrium, predict
from dlocore.compiling.interrupts import interruptible, let_in
from tests.solver.scenes import cable, march, paper_scene

METHODS = {
    "march": march(9, 13),
    "auto": Quality(),
    "spacetime": Quality(n_u=9, n_t=13, method="spacetime", keep_grid=True),
    "paper": Quality(n_u=9, n_t=13, method="paper"),
}
SLOW = {  # each takes 30 times the longest deadline or more
    "march": march(129, 513),
    "auto": Quality(target_error=1e-6),
    "spacetime": Quality(n_u=33, n_t=97, method="spacetime", keep_grid=True),
    "paper": Quality(n_u=13, n_t=19, method="paper"),
}
every_method = pytest.mark.parametrize("method", METHODS)


@every_method
def test_a_cancelled_solve_stops_at_the_next_look(method):
    looks = 0

    def cancelled() -> bool:
        nonlocal looks
        looks += 1
        return looks > 1

    with pytest.raises(Cancelled):
        predict(paper_scene(0.25, quality=replace(METHODS[method], estimate=True)), cancelled=cancelled)
    assert looks == 2


def test_a_running_solve_is_cancelled_within_an_iteration():
    scene = paper_scene(0.25, 1e-4, quality=Quality(n_u=17, n_t=49, delta=1e-10, keep_grid=True))
    seen: list[Iteration] = []
    whole = len(predict(scene).iterations)
    with pytest.raises(Cancelled):
        predict(scene, on_iteration=seen.append, cancelled=lambda: len(seen) >= 2)
    assert len(seen) == 2 < whole - 1


@every_method
@pytest.mark.parametrize("deadline", [0.0, 1e-3, 5e-3])
def test_a_deadline_gives_a_finite_surface_and_says_so(method, deadline):
    prediction = predict(paper_scene(0.25, 1e-4, quality=SLOW[method]), deadline=deadline)
    assert prediction.status == "time_limit", prediction.message
    assert np.isfinite(prediction.surface.control_points).all()
    assert prediction.message.startswith("The time limit passed")


@pytest.mark.parametrize("deadline", [0.005, 0.01, 0.02, 0.03])
def test_a_deadline_is_kept(deadline):
    scene = paper_scene(0.25, 1e-4, quality=Quality(target_error=1e-6))
    began = time.thread_time()  # whatever else the machine is busy with
    prediction = predict(scene, deadline=deadline)
    assert prediction.status == "time_limit", prediction.message
    assert time.thread_time() - began < deadline + 0.3  # 256 steps of a fine grid on a slow machine


def test_statics_keep_deadlines_and_can_be_cancelled():
    load = Load(u=1.0, force=(0.0, 0.0, -0.01))
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.0, hold="tangent"),), loads=(load,), horizon=1.0)
    with pytest.raises(Cancelled):
        equilibrium(scene, cancelled=lambda: True)
    found = equilibrium(scene, deadline=0.002)
    assert np.isfinite(found.control_points).all()


@every_method
def test_every_iteration_is_reported_as_it_is_recorded(method):
    seen: list[Iteration] = []
    prediction = predict(paper_scene(0.25, quality=METHODS[method]), on_iteration=seen.append)
    assert tuple(seen) == prediction.iterations
    assert [step.number for step in seen] == list(range(len(seen)))
    times = [step.wall_time for step in seen]
    assert times == sorted(times)
    assert all(step.residual >= 0 for step in seen)
    last = seen[-1].surface.control_points
    np.testing.assert_array_equal(prediction.surface.control_points, last)


def test_residual_of_the_least_squares_falls():
    steps = predict(paper_scene(0.25)).iterations
    assert steps[-1].residual < steps[0].residual
    assert steps[-1].update < 1e-5 < steps[0].update


def test_a_jump_that_no_grid_resolves_is_not_called_converged():
    path = Move(displacement=(0.0, 0.9, 0.0), duration=2e-3)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.5, path=path),), horizon=1.0)
    prediction = predict(scene)
    assert np.isfinite(prediction.surface.control_points).all()
    assert prediction.status == "stalled"
    assert "which no cable can follow" in prediction.message
    assert len(prediction.iterations) < 8  # it is torn on one grid after the other, which no finer one takes back


def test_effects_are_reported_with_reasons_and_sizes():
    prediction = predict(paper_scene(0.25))
    effects = {e.name: e for e in prediction.effects}
    assert effects["table"].active
    assert not effects["gravity"].active
    assert effects["inertia"].magnitude > 0
    assert all(e.reason for e in effects.values())
    off = replace(paper_scene(0.25), effects={"drag": "off"})
    assert not {e.name: e for e in predict(off).effects}["drag"].active


INTERRUPTED = """
import os, signal, threading
from dlocore import Quality, predict
from tests.solver.scenes import paper_scene
signal.signal(signal.SIGINT, signal.default_int_handler)  # which a process in the background ignores
scene = paper_scene(0.25, quality=Quality(n_u=25, n_t=37, method="march", estimate=False))
predict(scene)
for k in range(20):
    timer = threading.Timer(0.01 + 1e-3 * k, os.kill, (os.getpid(), signal.SIGINT))
    try:
        timer.start()
        while True:
            predict(scene)
    except KeyboardInterrupt:
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        print("interrupted")
"""


def test_interrupts_between_and_within_predictions_are_errors_of_python():
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (ended.returncode, ended.stdout.count("interrupted")) == (0, 20), ended.stderr


@pytest.fixture
def heeded() -> Iterator[None]:
    """Let interrupts be errors of Python, also where this process was begun in the background, and ignores them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeded")
def test_a_long_solve_is_interrupted_soon():
    scene = paper_scene(0.25, quality=Quality(target_error=1e-6))
    predict(scene, deadline=0.1)
    began, timer = time.thread_time(), threading.Timer(0.2, signal.raise_signal, (signal.SIGINT,))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        predict(scene, deadline=20.0)
    assert time.thread_time() - began < 1.2


def called_in(module, call):
    """Call something within the globals of a module, as compiled code does."""
    exec("call()", {"__name__": module, "call": call})


@pytest.mark.parametrize("module", ["numba.core.serialize", "namedtuple_Tables", "llvmlite.binding.executionengine"])
def test_an_interrupt_of_compiled_code_comes_at_the_next_look_or_at_the_end(module):
    came: list[str] = []

    @interruptible
    def solve(look):
        called_in(module, lambda: signal.raise_signal(signal.SIGINT))
        came.append("held")
        look()
        came.append("end")

    before = signal.signal(signal.SIGINT, lambda *_: came.append("handled"))
    try:
        solve(let_in)
        assert came == ["held", "handled", "end"]
        came.clear()
        solve(lambda: None)
        assert came == ["held", "end", "handled"]
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heeded")
def test_other_threads_and_processes_that_ignore_interrupts_are_left_alone():
    handlers = []
    note = interruptible(lambda: handlers.append(signal.getsignal(signal.SIGINT)))
    thread = threading.Thread(target=note)
    thread.start()
    thread.join()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        note()
    finally:
        signal.signal(signal.SIGINT, before)
    assert handlers == [before, signal.SIG_IGN]

"""After `warm_up` nothing is left to compile, whatever a scene calls for."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from dlocore import Cancelled, SceneError, warm_up, warming

PROGRAM = """
import sys
from dataclasses import replace
from numba.core.dispatcher import Dispatcher
from benchmarks.catalogue import catalogue
from dlocore import Quality, SceneError, predict, sensitivities, warm_up

def compiled():
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("dlocore")]
    found = {f for m in modules for f in vars(m).values() if isinstance(f, Dispatcher)}
    return {(f.__module__, f.__name__, str(s)) for f in found for s in f.signatures}

def read(answer):
    answer.message, answer.grasps, answer.effects, answer.material, answer.start_energy
    [(i.surface, i.energy) for i in answer.iterations]
    answer.energies([0.0, answer.surface.horizon])

warm_up()
before = compiled()
assert len(before) > 40, before
for count, (name, scene) in enumerate(catalogue().items()):
    for method in ("march", "spacetime", *(["paper"] if count == 0 else [])):
        try:
            given = Quality(n_u=13, n_t=19, method=method, keep_grid=True)
            answer = predict(replace(scene, quality=given), deadline=2.0)
            read(answer)
            predict(answer.scene, like=answer)
            if method == "march":
                sensitivities(answer, ["cable.bending_stiffness"])
        except SceneError as error:
            assert error.field.startswith("quality"), (name, error)  # so small a grid is refused for a few
            continue
        if method == "march" and count % 3 == 0:
            try:
                read(predict(replace(answer.scene, shape=answer.shape_at()), deadline=2.0))
            except SceneError as error:
                assert error.field.startswith("primitives"), (name, error)  # it can't go the same way once more
    new = compiled() - before
    assert not new, (name, sorted((module, function) for module, function, _ in new))
"""


def test_nothing_is_compiled_in_a_solve_or_its_derivatives_after_warm_up():
    # in a process of its own: the tests before have compiled other things
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=540)
    assert done.returncode == 0, done.stderr


LEFT_BEHIND = """
import os, sys, threading, time
from dlocore import warming
started = []
class Seen(warming.subprocess.Popen):
    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        started.append(self.pid)
warming.subprocess.Popen = Seen
threading.Thread(target=warming.warm_up, args=(2,), daemon=True).start()
while len(started) < 2:
    time.sleep(0.05)
print(*started, flush=True)
if len(sys.argv) > 1:
    os.kill(os.getpid(), int(sys.argv[1]))
"""


@pytest.mark.parametrize("by", [None, signal.SIGTERM, signal.SIGKILL], ids=["ends", "terminated", "killed"])
def test_a_program_that_ends_while_it_compiles_takes_its_processes_along(
    tmp_path: Path, by: signal.Signals | None
) -> None:
    cold = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", LEFT_BEHIND, *([] if by is None else [str(int(by))])]
    done = subprocess.run(command, env=cold, capture_output=True, text=True, timeout=120)
    assert done.returncode == -(by or 0), done.stderr
    processes = [int(pid) for pid in done.stdout.split()]
    assert len(processes) == 2
    give_up = time.monotonic() + 60
    while any(map(runs, processes)):  # until they have imported what they compile, and look
        assert time.monotonic() < give_up
        time.sleep(0.05)


def runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture
def shares(monkeypatch: pytest.MonkeyPatch) -> list["subprocess.Popen[bytes]"]:
    """The processes that a warm-up starts of three shares, which are programs here; none of the kernels is compiled."""
    started: list[subprocess.Popen[bytes]] = []

    class Program(subprocess.Popen[bytes]):
        def __init__(self, command: list[str], **options: Any) -> None:
            super().__init__([*command[:1], "-c", command[-1]], **options)
            started.append(self)

    monkeypatch.setattr(warming.subprocess, "Popen", Program)
    monkeypatch.setattr(warming, "is_compiled", lambda: False)
    monkeypatch.setattr(warming, "PARTS", {})
    return started


SLEEPS, ENDS, IS_KILLED = "import time; time.sleep(60)", "", "import os; os.kill(os.getpid(), 9)"


@pytest.mark.parametrize(("first", "count"), [(ENDS, 3), ("raise ValueError", 3), (IS_KILLED, 1)])
def test_where_a_share_is_killed_no_other_is_begun(
    shares: list["subprocess.Popen[bytes]"], monkeypatch: pytest.MonkeyPatch, first: str, count: int
) -> None:
    monkeypatch.setattr(warming, "SHARES", ((first,), (ENDS,), (ENDS,)))
    warm_up(1)
    assert len(shares) == count


def test_a_cancelled_warm_up_ends_what_it_has_begun(
    shares: list["subprocess.Popen[bytes]"], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warming, "SHARES", ((SLEEPS,), (SLEEPS,), (SLEEPS,)))
    with pytest.raises(Cancelled):
        warm_up(2, cancelled=lambda: len(shares) > 0)
    assert [share.returncode for share in shares] == [-signal.SIGKILL] * 2


@pytest.mark.parametrize("processes", [0, -1, 1.5, "2", True, 10_000])
def test_it_takes_a_number_of_processes(processes: Any) -> None:
    with pytest.raises(SceneError, match="processes"):
        warm_up(processes)


def test_one_process_is_started_for_each_core_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[int] = []
    monkeypatch.setattr(warming, "is_compiled", lambda: False)
    monkeypatch.setattr(warming, "usable_cores", lambda: 3)
    monkeypatch.setattr(warming, "_compile_in_processes", lambda at_once, check: started.append(at_once))
    monkeypatch.setattr(warming, "PARTS", {})
    warm_up()
    assert started == [3]

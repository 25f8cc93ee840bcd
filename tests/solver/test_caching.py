"""Compiled code is kept on disk so that processes which compile at once each find what they made."""

import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from dlocore.compiling.caching import OverloadFiles

ROOT = Path(__file__).parents[2]
# One function, compiled for a signature of each process, as two processes do that begin at once.
PROGRAM = """
import sys
import numba, numpy as np
from dlocore.compiling.caching import is_kept, kept
sys.path.insert(0, sys.argv[1])
from doubled import doubled
function = kept(numba.njit(cache=True)(doubled), sys.argv[2])
print(is_kept(function))
for kind in sys.argv[3:]:
    print(function(np.ones(2, kind)).dtype)
    print(sum(function.stats.cache_hits.values()), sum(function.stats.cache_misses.values()))
"""
# A caller is compiled where what it calls is loaded.
CALLER = """
import sys
import numba, numpy as np
from dlocore.compiling.caching import kept
sys.path.insert(0, sys.argv[1])
from doubled import doubled as plain
doubled = kept(numba.njit(cache=True)(plain), "a")

@numba.njit
def four_times(x):
    return doubled(doubled(x))

print(four_times(1.5))
print(sum(doubled.stats.cache_hits.values()), sum(doubled.stats.cache_misses.values()))
made = four_times.inspect_llvm(four_times.signatures[0]).splitlines()
print(any("call" in line and "doubled" in line for line in made))
"""
# What is compiled as a scene is solved whose code is all there.
SOLVE = """
from numba.core import event

class Told(event.Listener):
    def on_start(self, compiled):
        print(compiled.data["dispatcher"].py_func.__qualname__)

    def on_end(self, compiled):
        pass

event.register("numba:compile", Told())
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict
clamps = Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=Move(displacement=(-0.1, 0.1, 0.0), duration=1.0))
quality = Quality(n_u=9, n_t=9, method="march")
for table in (None, Table()):
    around = Environment(table=table)
    predict(Scene(cable=Cable.preset("paper"), shape=Straight(), grasps=clamps, environment=around, quality=quality))
"""


def compiled(folder: Path, source: str, *kinds: str) -> "subprocess.Popen[str]":
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-c", PROGRAM, str(folder), source, *kinds]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)


def test_processes_that_compile_a_function_at_once_each_find_their_own_code(tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text("def doubled(x):\n    return x + x\n")
    kinds = ["float64", "float32", "int64", "complex128"]
    for process in [compiled(tmp_path, "a", kind) for kind in kinds]:
        process.communicate(timeout=120)
        assert process.returncode == 0
    said, _ = compiled(tmp_path, "a", *kinds).communicate(timeout=120)
    assert said.split() == ["True", *(word for k, kind in enumerate(kinds, 1) for word in (kind, str(k), "0"))]
    said, _ = compiled(tmp_path, "b", "float64").communicate(timeout=120)  # of another source nothing is kept
    assert said.split() == ["False", "float64", "0", "1"]


def test_what_is_loaded_is_inlined_into_what_calls_it(tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text("def doubled(x):\n    return x + x\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-c", CALLER, str(tmp_path)]
    for hits, misses in ((0, 1), (1, 0)):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["6.0", str(hits), str(misses), "False"]


def test_a_fresh_process_compiles_nothing_that_another_has_compiled() -> None:
    for _ in range(2):
        said = subprocess.run(
            [sys.executable, "-c", SOLVE], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
    assert said.split() == []


def test_what_is_saved_at_once_is_not_mixed_up(tmp_path: Path) -> None:
    files = [OverloadFiles(str(tmp_path), "f", "source") for _ in range(8)]
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda k: files[k % 8].save(("signature", k), bytes([k]) * 10_000), range(200)))
    assert all(files[0].load(("signature", k)) == bytes([k]) * 10_000 for k in range(200))
    files[0].flush()
    assert files[1].load(("signature", 3)) is None


def test_what_cant_be_written_whole_is_not_kept(tmp_path: Path) -> None:
    files = OverloadFiles(str(tmp_path), "f", "source")
    with pytest.raises((pickle.PicklingError, TypeError, AttributeError)):
        files.save("signature", (_ for _ in ()))
    assert list(tmp_path.iterdir()) == []
    assert files.load("signature") is None


def test_what_is_not_of_the_present_source_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "f.1.nbc").write_bytes(b"no pickle, as of another program")
    OverloadFiles(str(tmp_path), "f", "before").save("signature", 1)
    files = OverloadFiles(str(tmp_path), "f", "now")
    assert not files.any()
    assert files.load("signature") is None
    files.save("signature", 2)
    assert files.any()
    assert files.load("signature") == 2

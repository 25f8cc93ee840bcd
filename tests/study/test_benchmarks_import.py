"""Benchmarks are run seldom: that they find all that they take from the program, and measure what they say."""

import importlib
import os
import pkgutil
import runpy
import subprocess
import sys

import pytest

import benchmarks
import benchmarks.hard.__main__ as hard
from benchmarks.hard.cases import CASES
from benchmarks.paper_case import GRASPS, METHODS, paper_scene
from dlocore import predict

PEERS = ("mujoco", "elastica")  # an extra
MODULES = [module.name for module in pkgutil.walk_packages(benchmarks.__path__, "benchmarks.")]


@pytest.mark.parametrize("name", MODULES)
def test_benchmark_finds_what_it_takes_from_the_program(name: str) -> None:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name not in PEERS:
            raise
        pytest.skip(f"{error.name} is not installed")


def test_all_benchmarks_are_looked_at() -> None:
    assert {"benchmarks.choices", "benchmarks.hard.generator", "benchmarks.peers.cosserat"} <= set(MODULES)


def test_benchmarks_set_the_number_of_threads_before_numpy_reads_it() -> None:
    program = "import os, sys; import benchmarks; print(os.environ['OMP_NUM_THREADS'], 'numpy' in sys.modules)"
    around = {name: value for name, value in os.environ.items() if not name.endswith("_THREADS")}
    done = subprocess.run([sys.executable, "-c", program], env=around, capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["1", "False"], done.stderr


@pytest.mark.parametrize("name", ["benchmarks.choices", "benchmarks.health"])
def test_help_measures_nothing(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(importlib.import_module(name).__file__), run_name="__main__")
    assert end.value.code == 0
    assert f"python -m {name}" in capsys.readouterr().out


def test_a_hard_case_that_is_not_there_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmarks.hard", "--cases", "no such"])
    with pytest.raises(SystemExit) as end:
        hard.main()
    assert end.value.code == 2
    assert f"got 'no such'. Allowed: a part of the name of one of {next(iter(CASES))}, " in capsys.readouterr().err


@pytest.mark.parametrize("method", ["march", "spacetime"])
def test_a_row_of_the_papers_case_is_of_the_grid_that_it_names(method: str) -> None:
    """That of the softest cable errs by more than 1 % of the length, for which finer grids would be the answer."""
    accuracy = [predict(paper_scene(1e-4, grasp, METHODS[method])).accuracy for grasp in GRASPS]
    assert {(a.n_u, a.n_t) for a in accuracy} == {(9, 13)}
    assert max(a.error_estimate or 0.0 for a in accuracy) > 0.01

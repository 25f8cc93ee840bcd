"""Benchmarks are run seldom: that they find all that they take from the program is checked here."""

import importlib
import pkgutil

import pytest

import benchmarks

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

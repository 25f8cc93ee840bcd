"""Compiled functions that count no references to arrays must not return or get any: nobody would let go of them."""

import importlib
import inspect
import pkgutil

import pytest
from numba.core.dispatcher import Dispatcher

import dlocore.effects
import dlocore.kernels

MODULES = [
    f"{package.__name__}.{module.name}"
    for package in (dlocore.effects, dlocore.kernels)
    for module in pkgutil.iter_modules(package.__path__)
]


def uncounted(module):
    """Return the functions of a module that were compiled by `leaf` or `law`."""
    found = [f for f in vars(importlib.import_module(module)).values() if isinstance(f, Dispatcher)]
    return [f for f in found if f.py_func.__module__ == module and not f.targetoptions["_nrt"]]


def arrays_of(function):
    """Tell whether a compiled function may return arrays, by its annotation."""
    return "Any" in str(inspect.signature(function.py_func).return_annotation)


@pytest.mark.parametrize("module", MODULES)
def test_leaves_and_laws_return_numbers_and_are_handed_no_new_array(module):
    for function in uncounted(module):
        assert not arrays_of(function), function.__name__
        code = function.py_func.__code__
        called = [function.py_func.__globals__.get(name) for name in code.co_names]
        called += [getattr(x, name, None) for x in called if inspect.ismodule(x) for name in code.co_names]
        makers = [f.__name__ for f in called if isinstance(f, Dispatcher) and arrays_of(f)]
        assert not makers, (function.__name__, makers)


def test_there_are_leaves_and_laws():
    names = {f.__name__ for module in MODULES for f in uncounted(module)}
    assert {"assemble", "reduce_matrix", "bending_moment", "curvature_stress"} <= names

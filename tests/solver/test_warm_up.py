"""After `warm_up` nothing is left to compile, whatever a scene calls for."""

import subprocess
import sys

PROGRAM = """
import sys
from dataclasses import replace
from numba.core.dispatcher import Dispatcher
from benchmarks.catalogue import catalogue
from dlocore import Quality, SceneError, energies, predict, warm_up

def compiled():
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("dlocore")]
    found = {f for m in modules for f in vars(m).values() if isinstance(f, Dispatcher)}
    return {(f.__module__, f.__name__, str(s)) for f in found for s in f.signatures}

warm_up()
before = compiled()
assert len(before) > 40, before
for name, scene in catalogue().items():
    for method in ("march", "spacetime"):
        try:
            answer = predict(replace(scene, quality=Quality(n_u=13, n_t=19, method=method)), deadline=2.0)
            answer.message, answer.grasps, answer.effects, answer.material, answer.start_energy
            [(i.surface, i.energy) for i in answer.iterations]
            energies(answer.scene, answer.surface, [0.0, answer.surface.horizon])
            predict(answer.scene, like=answer)
        except SceneError as error:
            assert error.field.startswith("quality"), (name, error)  # so small a grid is refused for a few
    new = compiled() - before
    assert not new, (name, sorted((module, function) for module, function, _ in new))
"""


def test_nothing_is_compiled_in_a_solve_after_warm_up():
    # in a process of its own: the tests before have compiled other things
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=540)
    assert done.returncode == 0, done.stderr

"""Importing the package is quick: what takes long to import waits until a solve needs it."""

import subprocess
import sys

PROGRAM = """
import sys
from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, Sphere, Straight, Table

Scene(
    cable=Cable.preset("paper"), shape=Points(points=[[0.0, 0.0], [0.3, 0.1], [0.6, 0.1], [1.0, 0.0]]),
    grasps=(Grasp(u=0.2, path=Move(displacement=(0.0, 0.1, 0.0), duration=1.0)),),
    environment=Environment(table=Table(), obstacles=(Sphere(center=(0.5, 0.5, 0.0), radius=0.1),)),
    quality=Quality(n_u=9, n_t=13),
)
slow = {"numba", "scipy.spatial", "scipy.interpolate", "fastapi", "pydantic", "viser", "rerun"} & set(sys.modules)
assert not slow, slow
"""


def test_a_scene_is_made_without_what_takes_long_to_import():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


FIRST = """
import sys
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict

grasp = Grasp(u=0.2, path=Move(displacement=(0.0, 0.1, 0.0), duration=1.0))
answer = predict(Scene(
    cable=Cable.preset("paper"), shape=Straight(), grasps=(grasp,), environment=Environment(table=Table()),
    quality=Quality(n_u=9, n_t=13, method="march"),
))
assert answer.status == "converged", answer.message
slow = {"scipy.interpolate", "scipy.optimize", "scipy.spatial"} & set(sys.modules)
assert not slow, slow
"""


def test_a_straight_cable_is_predicted_without_what_takes_long_to_import():
    done = subprocess.run([sys.executable, "-c", FIRST], capture_output=True, text=True, timeout=540)
    assert done.returncode == 0, done.stderr

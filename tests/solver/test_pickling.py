"""A prediction can be sent to another process: what is read from it there is what would have been read here."""

import pickle
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Table,
    Waypoints,
    predict,
)

PAPER = Cable.preset("paper")
SIDE = Grasp(u=0.25, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6))
ON_TABLE = Environment(drag=0.05, table=Table())
PEG = Cylinder(center=(0.6, 0.05, 0.0), radius=0.02, height=0.1)
LIFT = Waypoints(times=[0.0, 1.0], positions=[(0.25, 0.0, 0.0), (0.25, 0.2, 0.1)])
SEEN = Points(points=[[0.0, 0.0], [0.3, 0.1], [0.6, 0.1], [0.97, 0.05]], settle=True)
SCENES = {
    "free grids": Scene(cable=PAPER, shape=Straight(), grasps=[SIDE], environment=ON_TABLE),
    "least squares": Scene(
        cable=PAPER,
        shape=Straight(),
        grasps=[SIDE],
        environment=ON_TABLE,
        quality=Quality(n_u=9, n_t=13, method="spacetime"),
    ),
    "reference": Scene(
        cable=PAPER,
        shape=Straight(),
        grasps=[SIDE],
        environment=ON_TABLE,
        quality=Quality(target_error=0.02, method="reference"),
    ),
    "twisted": Scene(
        cable=PAPER,
        shape=Straight(),
        grasps=[Grasp(u=0.25, hold="clamp", path=LIFT)],
        environment=Environment(drag=0.1),
    ),
    "settled": Scene(cable=Cable.preset("paper", rest_shape="initial"), shape=SEEN, grasps=[Grasp(u=0.0)], horizon=0.5),
    "round a peg": Scene(
        cable=PAPER,
        shape=Straight(),
        grasps=[replace(SIDE, path=Move(displacement=(0.0, 0.2, 0.0), duration=1.0))],
        environment=Environment(drag=0.1, table=Table(friction=0.2), obstacles=[PEG]),
        quality=Quality(n_u=13, n_t=33, keep_grid=True),
    ),
}


def sent(prediction: Prediction) -> Prediction:
    return pickle.loads(pickle.dumps(prediction))  # type: ignore[no-any-return]


def read(prediction: Prediction) -> dict[str, Any]:
    """Return all that is read from a prediction, arrays as bytes."""
    surface, stretch, material = prediction.surface, prediction.stretch, prediction.material
    iterations = [(i.number, i.note, i.energy, i.surface.control_points.tobytes()) for i in prediction.iterations]
    return {
        "status": prediction.status,
        "message": prediction.message,
        "notes": prediction.notes,
        "surface": [x.tobytes() for x in (surface.control_points, surface.knots_u, surface.knots_t)],
        "reactions": [(g.u, g.times.tobytes(), g.reaction.tobytes(), g.moment.tobytes()) for g in prediction.grasps],
        "effects": prediction.effects,
        "stretch": [x.tobytes() for x in vars(stretch).values()],
        "material": None if material is None else [x.tobytes() for x in vars(material).values()],
        "energy": prediction.start_energy,
        "accuracy": prediction.accuracy,
        "iterations": iterations,
    }


@pytest.mark.parametrize("name", SCENES)
def test_all_that_is_read_from_a_prediction_is_the_same_once_it_was_pickled(name: str) -> None:
    prediction = predict(SCENES[name])
    assert read(sent(prediction)) == read(prediction)


def test_a_prediction_that_was_read_before_is_pickled_likewise() -> None:
    prediction = predict(SCENES["free grids"])
    before = read(prediction)
    assert read(sent(sent(prediction))) == before


@pytest.mark.parametrize("name", [name for name in SCENES if name != "reference"])
def test_a_motion_goes_on_from_one_that_was_pickled_as_from_the_one_itself(name: str) -> None:
    prediction = predict(SCENES[name])
    expected = predict(SCENES[name], like=prediction)
    found = predict(SCENES[name], like=sent(prediction))
    assert (found.judged is None) == (expected.judged is None)
    assert found.message == expected.message
    assert np.array_equal(found.surface.control_points, expected.surface.control_points)


def test_a_chain_starts_from_one_that_was_pickled_as_from_the_one_itself() -> None:
    prediction = predict(SCENES["twisted"])
    for a, b in zip(vars(prediction.shape_at()).values(), vars(sent(prediction).shape_at()).values(), strict=True):
        assert repr(a) == repr(b) or np.array_equal(a, b)


PROGRAM = """
import pickle, sys
prediction = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(prediction.surface.control_points.tobytes() + prediction.message.encode())
"""


def test_another_process_reads_the_same() -> None:
    prediction = predict(SCENES["free grids"])
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=pickle.dumps(prediction), capture_output=True, timeout=120
    )
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout == prediction.surface.control_points.tobytes() + prediction.message.encode()

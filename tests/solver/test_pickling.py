"""A prediction can be sent to another process: what is read from it there is what would have been read here.

Neither it nor its scene can be changed by writing to its arrays, here or there.
"""

import json
import operator
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from copy import copy, deepcopy
from dataclasses import asdict, fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    Cylinder,
    Environment,
    Grasp,
    Load,
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


def arrays_of(part: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Give the arrays that can be reached from a part by its fields, each with its name."""
    if isinstance(part, np.ndarray):
        yield name, part
    elif isinstance(part, tuple):
        for i, one in enumerate(part):
            yield from arrays_of(one, f"{name}[{i}]")
    elif is_dataclass(part):
        for field in fields(part):
            yield from arrays_of(getattr(part, field.name), f"{name}.{field.name}")


def as_it_is(part: Any) -> Any:
    return part


def pickled(part: Any) -> Any:
    return pickle.loads(pickle.dumps(part))


@pytest.mark.parametrize("kept", [as_it_is, pickled, deepcopy])
@pytest.mark.parametrize("name", ["free grids", "reference", "twisted", "settled", "round a peg"])
def test_what_an_answer_tells_cant_be_changed(name: str, kept: Callable[[Any], Any]) -> None:
    answer = kept(predict(SCENES[name]))
    surfaces = tuple(iteration.surface for iteration in answer.iterations)
    told = (answer.surface, surfaces, answer.grasps, answer.contacts, answer.stretch, answer.material)
    found = dict(arrays_of(told))
    assert len(found) >= 3 + 3 + 3
    assert [name for name, array in found.items() if array.flags.writeable] == []


FULL = Scene(
    cable=Cable.preset("paper", rest_shape=[(0.0, 0.0), (0.3, 0.1), (0.6, 0.1), (0.97, 0.05)]),
    shape=Points(points=[[0.0, 0.0], [0.3, 0.1], [0.6, 0.1], [0.97, 0.05]], velocity=(0.1, 0.0, 0.0)),
    grasps=[SIDE, Grasp(u=0.8, path=Waypoints(times=[0.0, 1.0], positions=[(0.8, 0.0, 0.0)] * 2))],
    loads=[Load(u=0.5, force=[(0.0, 0.0, 0.1)] * 2, times=[0.0, 1.0])],
    environment=Environment(obstacles=[PEG]),
    effects={"twist": "off"},
)


@pytest.mark.parametrize("kept", [as_it_is, pickled, deepcopy, copy])
def test_what_a_scene_was_checked_for_cant_be_changed(kept: Callable[[Any], Any]) -> None:
    scene = kept(FULL)
    found = dict(arrays_of((scene,)))
    assert found.keys() == dict(arrays_of((FULL,))).keys()
    assert len(found) >= 9
    assert [name for name, array in found.items() if array.flags.writeable] == []
    for write in (
        lambda: operator.setitem(scene.effects, "twist", "bogus"),
        lambda: operator.delitem(scene.effects, "twist"),
        lambda: operator.ior(scene.effects, {"stretch": "off"}),
        lambda: scene.effects.update(stretch="off"),
        lambda: scene.effects.pop("twist"),
        lambda: scene.effects.clear(),
    ):
        with pytest.raises(TypeError, match="read-only"):
            write()
    assert scene.effects == {"twist": "off"}
    assert replace(scene, horizon=2.0).effects == asdict(scene)["effects"] == {"twist": "off"}
    assert json.dumps(scene.effects) == '{"twist": "off"}'


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

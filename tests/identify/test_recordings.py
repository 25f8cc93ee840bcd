"""The format of recordings: what is read is what was written, and what is wrong is named."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlocore import SceneError
from dlocore.recordings import Hold, Recording, load_recording, save_recording

TIMES = np.arange(12) * 0.01


def markers(count: int = 5, frames: int = 12, columns: int = 3) -> np.ndarray:
    x = np.zeros((frames, count, columns))
    x[:, :, 0] = 0.1 * np.arange(count)
    return x


def recording(**changes: Any) -> Recording:
    return Recording(**({"times": TIMES, "markers": markers(), "held": (0,)} | changes))


def test_an_npz_is_read_as_it_was_written(tmp_path: Path) -> None:
    x = markers()
    x[3, 2] = np.nan
    first = recording(markers=x, held=(0, -1), linear_density=0.03, name="shaken")
    save_recording(first, tmp_path / "shaken.npz")
    again = load_recording(tmp_path / "shaken.npz")
    np.testing.assert_array_equal(np.asarray(again.markers), np.asarray(first.markers))
    assert (again.held, again.linear_density, again.name, again.length) == ((0, 4), 0.03, "shaken", first.length)


def test_a_csv_with_its_json_gives_the_same_recording(tmp_path: Path) -> None:
    x = markers(columns=2)
    rows = ["t," + ",".join(f"x{i},y{i}" for i in range(5))]
    rows += [f"{t}," + ",".join(f"{a},{b}" for a, b in frame) for t, frame in zip(TIMES, x, strict=True)]
    rows[4] = rows[4].rsplit(",", 2)[0] + ",,"  # the last marker was lost in one frame
    (tmp_path / "table.csv").write_text("\n".join(rows))
    (tmp_path / "table.json").write_text(json.dumps({"held": [0], "dimensions": 2, "gravity": [0, 0, 0]}))
    found = load_recording(tmp_path / "table.csv")
    seen = np.asarray(found.markers)
    assert np.isnan(seen[3, 4]).all()
    assert np.isnan(seen).sum() == 3
    np.testing.assert_array_equal(seen[0, :, :2], x[0])
    assert found.name == "table"


def test_close_held_neighbours_are_a_clamp_whose_inner_marker_is_held() -> None:
    u = [0.0, 0.02, 0.3, 0.5, 0.7, 0.98, 1.0]
    found = recording(markers=markers(7), u=u, held=(0, 1, -2, -1)).holds
    assert found == (Hold(1, 0, False), Hold(5, 6, True))


def test_far_held_neighbours_are_two_grippers() -> None:
    assert recording(held=(0, 1)).holds == (Hold(0), Hold(1))


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"times": [*TIMES[:4], 0.0, *TIMES[5:]]}, "times[4]"),
        ({"times": TIMES[:5], "markers": markers(frames=5)}, "times"),
        ({"markers": markers(frames=11)}, "markers"),
        ({"markers": markers() + np.inf}, "markers"),
        ({"held": (9,)}, "held[0]"),
        ({"held": (0, -5)}, "held"),
        ({"held": (0, 1, 2, 3, 4)}, "held"),
        ({"u": [0.0, 0.2, 0.1, 0.3, 0.4]}, "u"),
        ({"length": 0.1}, "length"),
        ({"linear_density": 0.0}, "linear_density"),
    ],
)
def test_what_is_wrong_with_a_recording_is_named(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(SceneError) as error:
        recording(**changes)
    assert error.value.field == field


def test_a_marker_that_is_never_seen_is_refused() -> None:
    x = markers()
    x[:, 2] = np.nan
    with pytest.raises(SceneError, match=r"markers\[:, 2\]"):
        recording(markers=x)


def test_files_that_are_no_recordings_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(b"nothing")
    np.savez(tmp_path / "b.npz", markers=markers())
    (tmp_path / "c.csv").write_text("0,1,2\n")
    for name in ("a.npz", "b.npz", "c.csv", "d.txt"):
        with pytest.raises((SceneError, OSError)):
            load_recording(tmp_path / name)

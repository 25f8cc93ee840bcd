"""The format of recordings: what is read is what was written, and what is wrong is named."""

import json
from collections.abc import Callable
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


@pytest.mark.parametrize(
    "as_given",
    [lambda x: x, list, lambda x: [list(frame) for frame in x]],
    ids=["array", "list of frames", "list of lists of markers"],
)
def test_what_is_masked_was_not_seen(as_given: Callable[[Any], Any]) -> None:
    x = np.ma.masked_array(markers())
    x[3, 2, 1] = np.ma.masked
    seen = np.asarray(recording(markers=as_given(x)).markers)
    assert np.argwhere(np.isnan(seen)).tolist() == [[3, 2, 0], [3, 2, 1], [3, 2, 2]]


@pytest.mark.parametrize("name", ["a.rec", "a", "a.csv"])
def test_it_is_written_under_a_name_that_is_read(tmp_path: Path, name: str) -> None:
    with pytest.raises(SceneError, match=rf"^recording: got {name}\. Allowed: a \.npz\.$"):
        save_recording(recording(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_what_is_no_recording_is_not_written(tmp_path: Path) -> None:
    given: Any = {"times": TIMES}
    with pytest.raises(SceneError, match=r"Allowed: a Recording\.$"):
        save_recording(given, tmp_path / "shaken.npz")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "unit"), [("diameter", "[m]"), ("linear_density", "[kg/m]")])
def test_a_number_out_of_range_is_refused_with_its_unit(name: str, unit: str) -> None:
    with pytest.raises(SceneError) as error:
        recording(**{name: 0.0})
    assert error.value.field == name
    assert error.value.allowed.endswith(unit)


@pytest.mark.parametrize("held", [0, "0", None])
def test_the_held_markers_are_a_list(held: Any) -> None:
    with pytest.raises(SceneError, match="markers' numbers") as error:
        recording(held=held)
    assert error.value.field == "held"


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


@pytest.mark.parametrize(("hold", "x"), [(Hold(1, 0, False), (0.3, 0.1)), (Hold(5, 6, True), (0.7, 0.9))])
def test_the_direction_of_a_clamp_is_that_of_larger_u(hold: Hold, x: tuple[float, float]) -> None:
    marker, towards = (np.array([[at, 0.0, 0.0], [0.0, at, 0.0]]) for at in x)
    np.testing.assert_array_equal(hold.along(marker, towards), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


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


@pytest.mark.parametrize(
    ("x", "length", "said"),
    [
        (1e3 * markers(), 0.4, "this looks like millimetres. Allowed: at least 400 m, to which the distances of"),
        (markers()[:, [0, 1, 3, 2, 4]], 0.4, "Markers 1 and 2 are 0.2 m apart: perhaps they are in another order."),
        (markers(), 0.3, "Allowed: at least 0.4 m, to which the distances of neighbouring markers add up"),
    ],
)
def test_distances_that_are_longer_than_the_cable_are_told(x: np.ndarray, length: float, said: str) -> None:
    with pytest.raises(SceneError) as error:
        recording(markers=x, length=length)
    assert error.value.field == "length"
    assert said in str(error.value)


def test_noise_makes_no_cable_longer_than_it_is() -> None:
    longer = 1.01 * markers()  # noise across the cable makes the distances of neighbours longer, never shorter
    known = recording(markers=longer, length=0.4)
    assert known.length == 0.4
    np.testing.assert_allclose(known.u, [0.0, 0.1, 0.2, 0.3, 0.4])
    with pytest.raises(SceneError, match=r"^length: got 0\.4\."):
        recording(markers=longer, u=1.01 * np.arange(5) * 0.1, length=0.4)  # which somebody measured


def test_zeros_of_markers_that_are_elsewhere_are_lost_ones() -> None:
    x = markers()
    x[:, 0, 2] = np.maximum(np.arange(12) - 6, 0) * 1e-3  # which is at the origin, and leaves it
    x[4:6, 3], x[0, 2], x[-1, 4] = 0.0, 0.0, 0.0
    lost = np.isnan(np.asarray(recording(markers=x).markers)[..., 0])
    assert sorted(np.argwhere(lost).tolist()) == [[0, 2], [4, 3], [5, 3], [11, 4]]
    flat = recording(markers=x[..., :2], u=0.1 * np.arange(5))
    assert np.isnan(np.asarray(flat.markers)).sum() == 3 * 4
    shapes = recording(markers=x, static=True)  # each of its own
    assert np.isfinite(np.asarray(shapes.markers)).all()


def test_zeros_of_a_gripper_beside_the_origin_are_lost_and_those_of_one_that_leaves_it_are_not() -> None:
    noise = 3e-4 * np.random.default_rng(4).standard_normal((12, 5, 3))
    x = markers() + noise
    x[:, 1] += (-0.06, 0.0, 0.0)  # 4 cm from the first one, where a clamp holds both
    x[5:8, 1] = 0.0
    assert np.flatnonzero(np.isnan(np.asarray(recording(markers=x).markers)[:, 1, 0])).tolist() == [5, 6, 7]
    sets_out = markers()
    sets_out[:, 0, 2] = np.maximum(np.arange(12) - 8, 0) * 2e-3  # at once, after a rest
    assert np.isfinite(np.asarray(recording(markers=sets_out).markers)).all()


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


def rows(first: int = 0) -> list[str]:
    x = markers()
    return [f"{t:.3f}," + ",".join(f"{v:g}" for v in frame.ravel()) for t, frame in zip(TIMES, x, strict=True)][first:]


def written(folder: Path, lines: list[str], facts: str = '{"held": [0]}', encoding: str = "utf-8") -> Path:
    (folder / "table.csv").write_text("\n".join(lines), encoding=encoding)
    (folder / "table.json").write_text(facts, encoding="utf-8")
    return folder / "table.csv"


@pytest.mark.parametrize("head", [[], ["t,x0,y0,z0"], ["", "t,x0,y0,z0"]])
def test_a_byte_order_mark_costs_no_frame(tmp_path: Path, head: list[str]) -> None:
    found = load_recording(written(tmp_path, head + rows(), encoding="utf-8-sig"))
    np.testing.assert_array_equal(np.asarray(found.times), np.round(TIMES, 3))


@pytest.mark.parametrize(
    ("head", "place"),
    [
        (["", "t,x0", "", "0,1,2"], "table.csv, line 4"),
        (["t,x0", *rows()[:3], "", "0.03," + 15 * "a,"], "table.csv, line 6"),
        (["t,x0", rows()[0].replace("0.000", "zero")], "table.csv, line 2"),
        (["zero" + rows()[0].removeprefix("0.000")], "table.csv, line 1"),
    ],
)
def test_a_wrong_row_is_named_by_its_line_of_the_file(tmp_path: Path, head: list[str], place: str) -> None:
    with pytest.raises(SceneError) as error:
        load_recording(written(tmp_path, [*head, *rows(4)]))
    assert error.value.field == place


@pytest.mark.parametrize(
    ("facts", "field", "said"),
    [
        ('{"dimensions": 4}', "recordings['table.csv'].dimensions", "4"),
        ('{"dimensions": "3"}', "recordings['table.csv'].dimensions", "'3'"),
        ('{"dimensions": true}', "recordings['table.csv'].dimensions", "True"),
        ('{"static": "false"}', "recordings['table.csv'].static", "'false'"),
        ('{"static": 0}', "recordings['table.csv'].static", "0"),
        ('{"name": 5}', "recordings['table.csv'].name", "5"),
        ('{"held": [9]}', "recordings['table.csv'].held[0]", "9"),
        ('{"held": [0], "held": [1]}', "table.json", "'held' 2 times"),
        ("[]", "table.json", "[]"),
        ("{", "table.json", "line 1"),
        ("[" * 100_000, "table.json", "recursion"),
    ],
)
def test_what_is_wrong_with_the_facts_of_a_table_is_named(tmp_path: Path, facts: str, field: str, said: str) -> None:
    with pytest.raises(SceneError) as error:
        load_recording(written(tmp_path, rows(), facts))
    assert error.value.field == field
    assert said in error.value.given


def test_a_table_without_its_facts_tells_which_file_is_missing(tmp_path: Path) -> None:
    path = written(tmp_path, rows())
    path.with_suffix(".json").unlink()
    with pytest.raises(SceneError, match=r"^table\.csv: got no table\.json in the same folder"):
        load_recording(path)


def test_text_in_another_encoding_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, ["Zeit in µs", *rows()], encoding="latin-1")
    with pytest.raises(SceneError, match=r"^table\.csv: .*UTF-8"):
        load_recording(path)
    written(tmp_path, rows()).with_suffix(".json").write_bytes(b'{"name": "\xb5"}')
    with pytest.raises(SceneError, match=r"^table\.json: .*UTF-8"):
        load_recording(path)


def damaged(good: bytes, how: str) -> bytes:
    at = good.index(b"NUMPY") + 200
    flipped = good[:at] + bytes([good[at] ^ 0xFF]) + good[at + 1 :]
    return {"cut": good[: len(good) // 2], "flipped": flipped, "empty": b""}[how]


@pytest.mark.parametrize("how", ["cut", "flipped", "empty"])
def test_a_damaged_npz_is_named(tmp_path: Path, how: str) -> None:
    np.savez(tmp_path / "good.npz", times=TIMES, markers=markers())
    (tmp_path / "bad.npz").write_bytes(damaged((tmp_path / "good.npz").read_bytes(), how))
    with pytest.raises(SceneError) as error:
        load_recording(tmp_path / "bad.npz")
    assert error.value.field == "bad.npz"


def test_an_npz_of_something_else_is_named(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", markers())
    (tmp_path / "one.npy").rename(tmp_path / "one.npz")
    np.savez(tmp_path / "objects.npz", times=TIMES, markers=np.array([{}]))
    np.savez(tmp_path / "words.npz", times=TIMES, markers=markers().astype(str))
    np.savez(tmp_path / "complex.npz", times=TIMES, markers=markers() + 1j)
    for name in ("one", "objects", "words", "complex"):
        with pytest.raises(SceneError) as error:
            load_recording(tmp_path / f"{name}.npz")
        assert f"{name}.npz" in error.value.field


def test_whether_it_rests_may_be_a_boolean_of_numpy() -> None:
    assert recording(static=np.bool_(True)).static is True


def test_the_first_of_times_that_do_not_rise_is_named() -> None:
    times = TIMES.copy()
    times[[3, 7]] = 0.01
    with pytest.raises(SceneError, match=r"times\[3\]: got 0\.01\."):
        recording(times=times)


def test_times_that_do_not_rise_are_shown_as_numbers() -> None:
    with pytest.raises(SceneError, match=r"times\[4\]: got 0\.02\."):
        recording(times=[*TIMES[:4], 0.02, *TIMES[5:]])

"""A recording in the scene: markers over the prediction, the error over time, the cable identified and kept."""

import asyncio
import json
import re
from dataclasses import replace
from pathlib import Path
from threading import get_ident
from unittest.mock import MagicMock

import numpy as np
import pytest
from protocol_client import SceneClient, connected

from app.service import searches
from app.store import cables
from app.store.cables import FILE, KeptCables
from app.viewer import tracked, tracking
from app.viewer.tracked import Tracked
from app.viewer.tracking import Tracking, TrackingActions
from app.viewer.tracking_report import error_card
from benchmarks.simulated_recordings import CABLE, DRAG, simulated
from dlocore import PointMass, SceneError
from dlocore.recordings import Recording, save_recording

OPEN = "Open a recording …"


@pytest.fixture(scope="module")
def recording() -> Recording:
    return replace(simulated(6, 1.5, cable=CABLE, environment=DRAG), name="shaken")


def npz(recording: Recording, folder: Path) -> bytes:
    save_recording(recording, folder / "shaken.npz")
    return (folder / "shaken.npz").read_bytes()


def shown_error(client: SceneClient) -> float:
    found = re.search(r'data-error="([0-9.]+)"', client.html("data-error"))
    return float(found[1]) if found else np.inf


def test_a_recording_is_seen_over_its_prediction_and_its_cable_is_found_and_kept(service, recording, tmp_path):
    with connected(service) as client:
        client.upload(OPEN, "shaken.npz", npz(recording, tmp_path))
        client.wait_for(lambda: client.html("data-error"), timeout=60)
        client.set("Time [s]", 1.0)  # it stands there
        client.wait_for(lambda: client.visible.get("/measured"))
        times, seen = np.asarray(recording.times), np.asarray(recording.markers)
        frame = seen[np.argmin(np.abs(times - times[:12].mean() - 1.0))]
        expected = frame[np.isfinite(frame[:, 0])]
        client.wait_for(lambda: _same(client.nodes["/measured"]["points"].reshape(-1, 3), expected))

        client.press("Identify the cable")
        client.wait_for(lambda: 'data-identify="converged"' in client.html("data-identify"), timeout=180)
        client.wait_for(lambda: abs(client.document["cable"]["bending_stiffness"] / 3e-3 - 1.0) < 0.15)
        assert "95 % intervals" in client.html("data-identify")
        client.refined()
        client.set("Time [s]", 1.0)  # it stands there
        # the noise of the markers is 1 mm in each direction; the prediction's own error is of that size
        client.wait_for(lambda: shown_error(client) < 4.0, timeout=60)

        client.set("Name of the preset", "my wire")
        client.press("Keep as a preset")
        client.wait_for(lambda: "my wire" in client.control("Preset")[1]["options"])
        client.wait_for(lambda: client.control("Preset")[1]["value"] == "my wire")
        kept = client.document
    with connected(service) as another:
        another.set("Preset", "my wire")
        another.wait_for(lambda: another.document["cable"].get("bending_damping"))
        found = another.document
        names = ("bending_stiffness", "bending_damping", "linear_density")
        assert [found["cable"][n] for n in names] == [kept["cable"][n] for n in names]
        assert found["environment"]["drag"] == kept["environment"]["drag"]
        assert found["cable"]["length"] == 1.0  # that of the scene


@pytest.mark.parametrize("limit", ["time", "number"])
def test_a_search_in_the_scene_keeps_the_limits_of_the_service(service, recording, tmp_path, monkeypatch, limit):
    if limit == "time":
        monkeypatch.setattr(service.app.state.service.worker, "time_limit", 1e-3)
    else:
        monkeypatch.setattr(searches, "WAITING", 0)
    with connected(service) as client:
        client.upload(OPEN, "shaken.npz", npz(recording, tmp_path))
        client.wait_for(lambda: client.html("was opened"), timeout=60)
        client.press("Identify the cable")
        words = "took longer than the limit of 0.001 s" if limit == "time" else "Too many identifications are waiting"
        client.wait_for(lambda: client.html(words), timeout=60)


def _same(points: np.ndarray, markers: np.ndarray) -> bool:
    return points.shape == markers.shape and bool(np.abs(points - markers).max() < 1e-5)  # single precision on the wire


def test_a_csv_waits_for_its_json_and_another_scene_takes_the_recording_away(service, recording):
    markers, times = np.asarray(recording.markers), np.asarray(recording.times)
    rows = [
        ",".join(["" if np.isnan(x) else f"{x:.5f}" for x in (t, *frame.ravel())])
        for t, frame in zip(times, markers, strict=True)
    ]
    facts = {"u": np.asarray(recording.u).tolist(), "held": list(recording.held), "length": 1.0, "linear_density": 0.05}
    with connected(service) as client:
        client.upload(OPEN, "table.json", json.dumps(facts).encode())
        client.wait_for(lambda: client.html("Now open table.csv"))
        client.upload(OPEN, "table.csv", "\n".join(rows).encode())
        client.wait_for(lambda: client.html("data-error"), timeout=60)
        client.upload(
            "Open a file …",
            "scene.json",
            json.dumps({"cable": {"preset": "paper"}, "shape": {"kind": "straight"}}).encode(),
        )
        client.wait_for(lambda: client.visible.get("/measured") is False)
        client.wait_for(lambda: not client.html("data-error"))


@pytest.mark.parametrize(("name", "content"), [("bad.npz", b"nothing"), ("scene.txt", b"1 2 3")])
def test_a_file_that_is_no_recording_is_refused_and_the_scene_stays(service, name, content):
    with connected(service) as client:
        before = client.document
        client.upload(OPEN, name, content)
        client.wait_for(lambda: "was not opened" in client.html("was not opened"))
        assert client.document == before


def test_a_recording_that_unpacks_to_more_than_is_allowed_is_refused(recording, tmp_path):
    long = np.zeros((tracked.LARGEST // 24 + 1, 3))
    np.savez_compressed(tmp_path / "long.npz", times=np.arange(len(long)), markers=long[:, None])
    with pytest.raises(SceneError, match=f"at most {tracked.LARGEST} bytes"):
        tracked.opened("long.npz", (tmp_path / "long.npz").read_bytes(), {})
    parts = {"times": recording.times, "markers": recording.markers}
    np.savez_compressed(tmp_path / "more.npz", **parts, other=long)  # which nobody unpacks
    assert tracked.opened("more.npz", (tmp_path / "more.npz").read_bytes(), {}).windows


def test_a_connector_is_in_the_scene_of_a_recording_and_an_edited_one_in_the_search(recording):
    connector = PointMass(u=0.5, mass=0.02)
    opened = tracked.Tracked.of(replace(recording, point_masses=(connector,)))
    draft = opened.draft()
    # 5 cm are in each gripper
    assert draft.get(("cable", "point_masses")) == [{"u": 0.45, "mass": 0.02}]
    heavier = draft.put(("cable", "point_masses", 0, "mass"), 0.03).put(("environment", "drag"), 0.08)
    edited = opened.edited(heavier.put(("cable", "bending_stiffness"), 2e-3)).candidate
    assert [(one.u, one.mass) for one in edited.cable.point_masses] == [(pytest.approx(0.5), 0.03)]
    assert (edited.cable.length, edited.cable.bending_stiffness, edited.environment.drag) == (1.0, 2e-3, 0.08)
    with pytest.raises(SceneError, match="a cable that yields"):
        opened.edited(draft.put(("cable", "yield_strain"), 0.01).put(("cable", "memory_rate"), 50.0))


@pytest.fixture
def two_windows() -> Tracked:
    return Tracked.of(simulated(6, 10.0, cable=CABLE, environment=DRAG))


def test_a_window_is_prepared_once_however_its_cable_is_edited(two_windows, monkeypatch):
    draft = two_windows.draft()
    monkeypatch.setattr(tracked, "Replay", None)  # no further one is made
    stiffer = draft.put(("cable", "bending_stiffness"), 4e-3)
    assert two_windows.edited(stiffer).draft().get(("cable", "bending_stiffness")) == 4e-3


def test_a_window_is_prepared_beside_the_event_loop_and_the_last_chosen_is_shown(two_windows, monkeypatch):
    threads, shown, prepare = [], [], Tracked.draft
    monkeypatch.setattr(Tracked, "draft", lambda self: threads.append(get_ident()) or prepare(self))
    monkeypatch.setattr(tracking, "opened", lambda *_: two_windows)

    async def choose() -> None:
        actions = TrackingActions(show=shown.append, draft=lambda: shown[-1], flush=MagicMock(), kept=MagicMock())
        scene = Tracking(MagicMock(), MagicMock(), MagicMock(), MagicMock(), actions)
        await scene.open("two.npz", b"")
        for number in (1, 0, 1):
            scene.window(number)
            await asyncio.sleep(0)  # it is being prepared
        while len(shown) < 2:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.05)

    asyncio.run(choose())
    assert threads
    assert get_ident() not in threads
    first, second = (replace(two_windows, shown=k).draft().primitives for k in (0, 1))
    assert first != second
    assert [draft.primitives for draft in shown] == [first, second]


def test_the_error_is_shown_at_the_cursor_and_over_time():
    times, distances = np.linspace(0.0, 2.0, 201), np.linspace(0.0, 0.02, 201)
    assert 'data-error="5.00"' in error_card(times, distances, 0.5)
    distances[:] = np.nan
    assert error_card(times, distances, 0.5) == ""


def test_kept_cables_outlive_the_service_and_a_damaged_file(tmp_path):
    cable = {"length": 2.0, "diameter": 0.01, "bending_stiffness": 0.2, "point_masses": [{"u": 2.0, "mass": 0.1}]}
    KeptCables(tmp_path).keep("one", cable, {"drag": 0.1})
    expected = {"one": {"cable": {"diameter": 0.01, "bending_stiffness": 0.2}, "environment": {"drag": 0.1}}}
    assert KeptCables(tmp_path).all() == expected
    (tmp_path / FILE).write_text("{")
    assert KeptCables(tmp_path).all() == {}


def test_a_cable_is_kept_only_under_a_name_that_tells_it_from_others_and_only_so_many_are(tmp_path, monkeypatch):
    monkeypatch.setattr(cables, "MOST", 1)
    kept = KeptCables(tmp_path)
    for name in ("  ", "x" * 61, "paper"):
        with pytest.raises(SceneError, match=r"Allowed: 1 to 60 characters, and no name of a preset of the library\."):
            kept.keep(name, {}, {})
    kept.keep("one", {}, {})
    kept.keep("one", {"diameter": 0.01}, {})
    with pytest.raises(SceneError, match=r"name: got .two.\. Allowed: the name of one of the 1 cables"):
        kept.keep("two", {}, {})
    assert list(kept.all()) == ["one"]

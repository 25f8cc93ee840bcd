"""A recording read back: entities, timelines, and values equal to the answer's."""

import json
import math
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import uvicorn
from fastapi.testclient import TestClient
from scipy.spatial.transform import Rotation

pytest.importorskip("rerun")
import rerun as rr

from app.archive import Run
from app.instants import instants
from app.recording.style import SAMPLES_U, STRIPS
from app.service.service import Service
from dlocore import effect_forces, energies
from dlocore.machine import machine_line
from tests.app.conftest import ROOT, paper_scene, put

LOGS = ("update", "residual")
ENTITIES = {
    "update": "/convergence/update",
    "residual": "/convergence/residual",
    "energy": "/energy/elastic",
    "damping": "/step/damping",
    "step_length": "/step/length",
}


@pytest.fixture(scope="module")
def chunks(client: TestClient, answer: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    return read(client, answer, tmp_path_factory.mktemp("rrd") / "run.rrd")


def read(client: TestClient, answer: dict[str, Any], path: Path) -> list[Any]:
    """Return all chunks of the recording of an answer, written to a path."""
    response = client.get(answer["links"]["recording"])
    assert response.status_code == 200
    path.write_bytes(response.content)
    reader = rr.chunk.RrdReader(path)
    (store,) = reader.recordings()
    assert store.application_id == "dlo"
    assert store.recording_id == answer["id"]
    (shown,) = reader.blueprints()
    assert shown.application_id == "dlo"
    return list(reader.stream(store=store).to_chunks())


def rows(chunks: list[Any], entity: str, component: str, timeline: str) -> tuple[list[Any], list[Any]]:
    """Return the times and the values of a component over a timeline; durations in seconds."""
    times: list[Any] = []
    values: list[Any] = []
    for chunk in chunks:
        if chunk.entity_path != entity or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        column = next(name for name in batch.schema.names if name.endswith(f":{component}"))
        whole = batch.column(timeline).cast("int64").to_pylist()  # nanoseconds, or a sequence
        times += whole if timeline == "iteration" else [1e-9 * t for t in whole]
        values += batch.column(column).to_pylist()
    return times, values


@pytest.mark.parametrize("field", ENTITIES)
def test_scalars_are_those_of_the_iterations(chunks: list[Any], answer: dict[str, Any], field: str) -> None:
    numbers, values = rows(chunks, ENTITIES[field], "scalars", "iteration")
    shown = {i["number"]: i[field] for i in answer["iterations"] if i[field] is not None}
    if field in LOGS:  # a zero has no logarithm and no row
        shown = {number: value for number, value in shown.items() if value > 0}
    assert numbers == list(shown)
    for number, (value,) in zip(numbers, values, strict=True):
        expected = math.log10(shown[number]) if field in LOGS else shown[number]
        assert value == pytest.approx(expected, rel=1e-12)


def test_the_solver_time_is_that_of_the_iterations(chunks: list[Any], answer: dict[str, Any]) -> None:
    times, _ = rows(chunks, "/energy/elastic", "scalars", "solver_time")
    assert times == pytest.approx([i["wall_time"] for i in answer["iterations"]], abs=2e-9)  # whole nanoseconds


def test_every_iterate_is_drawn_with_its_net(chunks: list[Any], answer: dict[str, Any]) -> None:
    numbers, shapes = rows(chunks, "/iterate/shape", "strips", "iteration")
    _, nets = rows(chunks, "/iterate/net", "positions", "iteration")
    assert numbers == [i["number"] for i in answer["iterations"]]
    assert [len(net) for net in nets] == [i["n_u"] * i["n_t"] for i in answer["iterations"]]
    last = np.array(answer["control_points"])[..., :3].reshape(-1, 3)
    np.testing.assert_allclose(nets[-1], last, rtol=0, atol=1e-6)  # single precision
    end = np.array(shapes[-1][-1])  # the last of the strips over time is the shape at the end
    np.testing.assert_allclose(end[[0, -1]], np.array(answer["surface"]["positions"])[-1, [0, -1]], rtol=0, atol=1e-6)


def test_the_motion_is_that_of_the_surface(chunks: list[Any], answer: dict[str, Any]) -> None:
    times, strips = rows(chunks, "/motion/cable", "strips", "motion")
    assert times == pytest.approx(answer["surface"]["t"], abs=2e-9)
    drawn = np.array([strip for (strip,) in strips])
    np.testing.assert_allclose(drawn, answer["surface"]["positions"], rtol=0, atol=1e-6)


def test_grasps_and_their_forces_move_along(chunks: list[Any], answer: dict[str, Any]) -> None:
    _, held = rows(chunks, "/motion/grasps/0", "positions", "motion")
    np.testing.assert_allclose([p for (p,) in held], np.array(answer["surface"]["positions"])[:, 25], rtol=0, atol=1e-6)
    _, arrows = rows(chunks, "/motion/reactions/0", "vectors", "motion")
    drawn, forces = np.array([a for (a,) in arrows]), np.array(answer["grasps"][0]["reaction"])
    largest = np.linalg.norm(forces, axis=1).max()
    assert np.linalg.norm(drawn, axis=1).max() == pytest.approx(0.25, rel=1e-5)  # a quarter of the cable's length
    np.testing.assert_allclose(drawn, forces * 0.25 / largest, rtol=0, atol=1e-6)


def test_the_longest_arrow_is_a_quarter_of_the_cable(client: TestClient, tmp_path: Path) -> None:
    twice = client.post("/v1/predictions", json=put(paper_scene(), "cable.length", 2.0)).json()
    _, arrows = rows(read(client, twice, tmp_path / "run.rrd"), "/motion/reactions/0", "vectors", "motion")
    assert np.linalg.norm(arrows, axis=-1).max() == pytest.approx(0.5, rel=1e-5)


def test_point_masses_move_along(client: TestClient, tmp_path: Path) -> None:
    request = put(paper_scene(), "cable.point_masses", [{"u": 0.5, "mass": 0.01}, {"u": 1.0, "mass": 0.02}])
    answer = client.post("/v1/predictions", json=request).json()
    assert answer["status"] == "converged"
    times, places = rows(read(client, answer, tmp_path / "run.rrd"), "/motion/point_masses", "positions", "motion")
    assert times == pytest.approx(answer["surface"]["t"], abs=2e-9)
    np.testing.assert_allclose(places, np.array(answer["surface"]["positions"])[:, [50, 100]], rtol=0, atol=1e-6)


def properties(chunks: list[Any]) -> dict[str, Any]:
    """Return the properties of a recording."""
    found: dict[str, Any] = {}
    for chunk in chunks:
        if chunk.entity_path == "/__properties":
            batch = chunk.to_record_batch().to_pydict()
            found |= {name.split(":")[1]: values[0][0] for name, values in batch.items() if ":" in name}
    return found


def test_a_recording_is_named_by_what_its_scene_has_and_dated(chunks: list[Any], answer: dict[str, Any]) -> None:
    found = properties(chunks)
    assert found["name"] == "cable of 1 m, 1 grasp, 1.6 s"
    assert found["start_time"] == pytest.approx(1e9 * datetime.fromisoformat(answer["created"]).timestamp(), abs=1e6)


def test_a_recording_is_named_as_its_run(client: TestClient, tmp_path: Path) -> None:
    document = client.post("/v1/predictions", json=paper_scene(name="Along the wall")).json()
    path = tmp_path / "run.rrd"
    path.write_bytes(client.get(document["links"]["recording"]).content)
    assert properties(rr.chunk.RrdReader(path).stream().to_chunks())["name"] == "Along the wall"


def page(chunks: list[Any], entity: str) -> str:
    (chunk,) = [chunk for chunk in chunks if chunk.entity_path == entity]
    assert chunk.is_static  # shown whatever the timeline
    batch = chunk.to_record_batch().to_pydict()
    ((text,),) = next(values for name, values in batch.items() if name.endswith(":text"))
    return str(text)


def test_the_report_has_status_settings_machine_and_scene(chunks: list[Any], answer: dict[str, Any]) -> None:
    text = page(chunks, "/report")
    assert answer["status"] in text
    assert answer["message"] in text
    assert answer["accuracy"]["method"] in text
    assert answer["id"] in text
    assert '`"auto"`' in text  # the requested quality
    assert machine_line() in text
    assert '"bending_stiffness": 0.001' in text


def test_the_effects_are_those_of_the_answer_with_their_reasons(chunks: list[Any], answer: dict[str, Any]) -> None:
    rows = [line.strip("| ").split(" | ") for line in page(chunks, "/effects").splitlines()[2:]]
    assert len(rows) == len(answer["effects"])
    told = {name: (active, why) for name, active, why, *_ in rows}
    for effect in answer["effects"]:
        assert told[effect["name"]] == ("yes" if effect["active"] else "no", effect["reason"])


@pytest.fixture(scope="module")
def run(client: TestClient, answer: dict[str, Any]) -> Run:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    found = service.runs.load(answer["id"])
    assert found is not None
    return found


def test_the_energies_of_an_iterate_are_those_at_its_end(chunks: list[Any], run: Run, answer: dict[str, Any]) -> None:
    terms = {}
    for name in ("kinetic", "bend", "stretch", "gravity"):
        numbers, values = rows(chunks, f"/energy/{name}", "scalars", "iteration")
        assert numbers == [i["number"] for i in answer["iterations"]]
        terms[name] = np.array([value for (value,) in values])
        expected = [
            energies(run.scene, i.surface, np.linspace(0, i.surface.horizon, 5))[name][-1] for i in run.iterations
        ]
        np.testing.assert_allclose(terms[name], expected, rtol=1e-12)
    elastic = [i["energy"] for i in answer["iterations"]]  # two ways to the same sum, apart by rounding
    np.testing.assert_allclose(terms["bend"] + terms["stretch"], elastic, rtol=1e-9)


def test_the_energies_of_iterates_of_a_cable_that_yields_add_up(client: TestClient, tmp_path: Path) -> None:
    """The iterates before the answer have another memory than the answer, and the first ones have none."""
    bent = json.loads((ROOT / "static" / "gallery" / "keeps-its-bend.json").read_text())
    document = client.post("/v1/predictions", json=bent).json()
    assert "calls for plasticity" in document["iterations"][0]["note"]
    path = tmp_path / "run.rrd"
    path.write_bytes(client.get(document["links"]["recording"]).content)
    chunks = list(rr.chunk.RrdReader(path).stream().to_chunks())
    numbers, bend = rows(chunks, "/energy/bend", "scalars", "iteration")
    _, stretch = rows(chunks, "/energy/stretch", "scalars", "iteration")
    elastic = {i["number"]: i["energy"] for i in document["iterations"]}
    assert {0, max(elastic)} <= set(numbers)
    assert np.add(bend, stretch)[:, 0] == pytest.approx([elastic[number] for number in numbers], rel=0.01)
    assert rows(chunks, "/forces/bend", "scalars", "iteration")[0] == numbers


def test_the_forces_are_those_of_every_active_effect(chunks: list[Any], run: Run) -> None:
    expected = effect_forces(run.scene, run.surface, np.linspace(0.0, run.surface.horizon, 17))
    assert {"inertia", "drag", "stretch", "bend"} <= set(expected)
    drawn = {c.entity_path.removeprefix("/forces/") for c in chunks if c.entity_path.startswith("/forces/")}
    assert drawn == set(expected)
    for name, force in expected.items():
        _, values = rows(chunks, f"/forces/{name}", "scalars", "iteration")
        assert values[-1][0] == pytest.approx(math.log10(force), rel=1e-9)  # the last iterate is the answer


def test_energies_and_reactions_are_plotted_over_the_motion(
    chunks: list[Any], run: Run, answer: dict[str, Any]
) -> None:
    for name, expected in energies(run.scene, run.surface, answer["surface"]["t"], stretch=run.stretch).items():
        times, values = rows(chunks, f"/over_time/energy/{name}", "scalars", "motion")
        assert times == pytest.approx(answer["surface"]["t"], abs=2e-9)
        np.testing.assert_allclose([value for (value,) in values], expected, rtol=1e-12)
    _, sizes = rows(chunks, "/over_time/reaction/0", "scalars", "motion")
    expected = np.linalg.norm(answer["grasps"][0]["reaction"], axis=1)
    np.testing.assert_allclose([size for (size,) in sizes], expected, rtol=1e-12)
    error = np.array(answer["grasps"][0]["reaction_error"])
    for bound, limit in (("least", np.maximum(expected - error, 0.0)), ("most", expected + error)):
        _, found = rows(chunks, f"/over_time/reaction/0/{bound}", "scalars", "motion")
        np.testing.assert_allclose([value for (value,) in found], limit, rtol=1e-12)
    assert answer["contacts"][0]["name"] == "table"
    _, borne = rows(chunks, "/over_time/reaction/contact_0", "scalars", "motion")
    np.testing.assert_allclose([size for (size,) in borne], answer["contacts"][0]["pressed"], rtol=1e-12)


def test_the_log_has_a_line_for_every_iteration(chunks: list[Any], answer: dict[str, Any]) -> None:
    numbers, lines = rows(chunks, "/log", "text", "iteration")
    assert numbers == [i["number"] for i in answer["iterations"]]
    for (line,), iteration in zip(lines, answer["iterations"], strict=True):
        assert f"residual {iteration['residual']:.3g}" in line
        assert ("update" in line) == (iteration["update"] is not None)  # the first has none


def test_the_net_is_drawn_along_the_cable_and_over_time(chunks: list[Any], answer: dict[str, Any]) -> None:
    _, lines = rows(chunks, "/iterate/net/lines", "strips", "iteration")
    assert [len(strips) for strips in lines] == [i["n_t"] + i["n_u"] for i in answer["iterations"]]
    control = np.array(answer["control_points"])[..., :3]
    np.testing.assert_allclose(lines[-1][len(control) - 1], control[-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(lines[-1][-1], control[:, -1], rtol=0, atol=1e-6)


def test_solve_and_motion_are_on_timelines_of_their_own(chunks: list[Any]) -> None:
    seen: dict[bool, set[tuple[str, ...]]] = {False: set(), True: set()}
    for chunk in chunks:
        if not chunk.is_static:
            moves = chunk.entity_path.startswith(("/motion", "/over_time"))
            seen[moves].add(tuple(sorted(chunk.timeline_names)))
    assert seen == {False: {("iteration", "solver_time")}, True: {("motion",)}}


@pytest.fixture(scope="module")
def obstructed(client: TestClient, tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    obstacles = [
        {"kind": "sphere", "center": [0.9, 0.9, 0], "radius": 0.02},
        {"kind": "capsule", "start": [1.1, 0.9, 0], "end": [1.1, 0.9, 0.3], "radius": 0.02},
        {"kind": "cylinder", "center": [0.5, 0.9, 0], "axis": [1, 0, 0], "radius": 0.02, "height": 0.1},
        {"kind": "box", "center": [0.7, 0.9, 0], "size": [0.1, 0.2, 0.3], "orientation": [0, 0, 0, 1]},
    ]
    document = client.post("/v1/predictions", json=put(paper_scene(), "environment.obstacles", obstacles)).json()
    path = tmp_path_factory.mktemp("rrd") / "run.rrd"
    path.write_bytes(client.get(document["links"]["recording"]).content)
    return list(rr.chunk.RrdReader(path).stream().to_chunks())


@pytest.mark.parametrize("origin", ["/iterate", "/motion"])
def test_obstacles_are_solids_that_stay(obstructed: list[Any], origin: str) -> None:
    drawn = {}
    for chunk in obstructed:
        if chunk.entity_path.startswith(f"{origin}/obstacles/"):
            assert chunk.is_static
            batch = chunk.to_record_batch().to_pydict()
            number = int(chunk.entity_path.rsplit("/", 1)[1])
            drawn[number] = {name.rsplit(":", 1)[1]: values[0][0] for name, values in batch.items() if ":" in name}
    assert set(drawn) == {0, 1, 2, 3}
    same = {"abs": 1e-6}  # single precision
    assert drawn[0]["half_sizes"] == pytest.approx([0.02] * 3, **same)
    assert drawn[0]["centers"] == pytest.approx([0.9, 0.9, 0.0], **same)
    assert drawn[1]["translations"] == pytest.approx([1.1, 0.9, 0.0], **same)  # its start; it extends along its z
    assert drawn[1]["lengths"] == pytest.approx(0.3, **same)
    assert drawn[2]["lengths"] == pytest.approx(0.1, **same)
    along = Rotation.from_quat(drawn[2]["quaternions"]).apply([0.0, 0.0, 1.0])  # xyzw, as rerun has them too
    assert along == pytest.approx([1.0, 0.0, 0.0], **same)
    assert drawn[3]["half_sizes"] == pytest.approx([0.05, 0.1, 0.15], **same)
    assert np.abs(drawn[3]["quaternions"]) == pytest.approx([0.0, 0.0, 1.0, 0.0], **same)  # half a turn about z


def test_a_recording_is_written_once_and_kept(client: TestClient, answer: dict[str, Any]) -> None:
    first = client.get(answer["links"]["recording"])
    assert client.get(answer["links"]["recording"]).content == first.content


def test_the_layout_is_for_these_recordings(client: TestClient, tmp_path: Path) -> None:
    path = tmp_path / "layout.rbl"
    path.write_bytes(client.get("/rerun/layout.rbl").content)
    (store,) = rr.chunk.RrdReader(path).blueprints()
    assert store.application_id == "dlo"


def test_the_viewer_link_opens_layout_and_recording_from_this_service(
    client: TestClient, answer: dict[str, Any]
) -> None:
    response = client.get(answer["links"]["viewer"], follow_redirects=False)
    assert response.status_code == 307
    address = response.headers["location"]
    assert address.startswith("/rerun/?")
    assert f"url=http://testserver{answer['links']['recording']}" in address
    assert "url=http://testserver/rerun/layout.rbl" in address
    page = client.get(address)
    assert "re_viewer.js" in page.text
    assert "connect-src 'self'" in page.headers["content-security-policy"]
    wasm = client.get("/rerun/re_viewer_bg.wasm")
    assert wasm.headers["content-type"] == "application/wasm"
    assert wasm.content[:4] == b"\0asm"
    assert client.get("/rerun/../settings").status_code == 404


@pytest.mark.parametrize(("proxy", "scheme"), [("127.0.0.1", "https"), ("10.0.0.1", "http")])
def test_behind_a_proxy_with_tls_the_viewer_is_given_addresses_with_tls(
    client: TestClient, answer: dict[str, Any], proxy: str, scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("FORWARDED_ALLOW_IPS", raising=False)
    served = uvicorn.Config(client.app, log_config=None)
    served.load()
    outside = TestClient(served.loaded_app, base_url="http://lab.example", client=(proxy, 50000))
    headers = {"x-forwarded-proto": "https", "x-forwarded-for": "10.0.0.2"}
    response = outside.get(answer["links"]["viewer"], headers=headers, follow_redirects=False)
    assert f"url={scheme}://lab.example{answer['links']['recording']}" in response.headers["location"]


def test_the_trace_of_a_motion_and_its_iterates_is_at_instants_of_its_way(chunks: list[Any], run: Run) -> None:
    t = instants(run.surface, STRIPS)
    shapes = run.surface.positions(np.linspace(0.0, run.surface.length, SAMPLES_U), t)
    _, iterates = rows(chunks, "/iterate/shape", "strips", "iteration")
    np.testing.assert_allclose(iterates[-1], shapes, rtol=0, atol=1e-6)
    static = {chunk.entity_path: chunk for chunk in chunks if chunk.is_static}
    traced = static["/motion/trace/cable"].to_record_batch().to_pydict()
    np.testing.assert_allclose(traced["LineStrips3D:strips"][0], shapes, rtol=0, atol=1e-6)
    arrows = static["/motion/trace/reactions/0"].to_record_batch().to_pydict()
    held = run.surface.positions([run.scene.grasps[0].u], t)[:, 0]
    np.testing.assert_allclose(arrows["Arrows3D:origins"][0], held, rtol=0, atol=1e-6)


def test_the_friction_of_a_rough_table_is_drawn(client: TestClient, tmp_path: Path) -> None:
    rough = client.post("/v1/predictions", json=put(paper_scene(), "environment.table", {"friction": 0.3})).json()
    _, drawn = rows(
        read(client, rough, tmp_path / "run.rrd"), "/over_time/reaction/contact_0_friction", "scalars", "motion"
    )
    sizes = np.linalg.norm(rough["contacts"][0]["friction"], axis=1)
    assert sizes.max() > 0.1  # N
    np.testing.assert_allclose([size for (size,) in drawn], sizes, rtol=1e-12)

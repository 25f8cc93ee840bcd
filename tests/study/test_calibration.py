"""The calibration of a machine: measured, stored, read again."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dlocore import Cancelled, calibration
from dlocore.calibration import Calibration
from dlocore.study import calibrating


@pytest.fixture(scope="module")
def measured() -> Calibration:
    """A calibration on few grids: of whole ones the grids are all that differs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrating, "GRIDS", {"march": ((9, 13), (13, 19), (17, 25)), "spacetime": ((9, 13), (13, 19))})
        return calibrating.measure(repeats=1)


def test_a_finer_grid_takes_more_steps_and_errs_less(measured: Calibration) -> None:
    for dimensions in (2, 3):
        marches = [p for p in measured.of_dimensions(dimensions) if p.method == "march"]
        assert [p.n_u for p in marches] == [9, 13, 17]
        assert all(p.converged for p in marches)
        # both paths of refinement: the error of these smooth motions falls at least with the second power of the grid
        assert marches[0].error > 2 * marches[-1].error > 0
        assert [p.steps for p in marches] == sorted({p.steps for p in marches})
        assert all(p.wall_time > 0 for p in marches)


def test_the_front_leaves_out_what_another_point_beats(measured: Calibration) -> None:
    points = measured.of_dimensions(2)
    front = calibration.front_of(points)
    assert front
    best = [points[i] for i in front]
    assert [p.wall_time for p in best] == sorted(p.wall_time for p in best)
    assert [p.error for p in best] == sorted((p.error for p in best), reverse=True)


def test_the_default_quality_is_measured_with_its_estimate_beside_the_grids(measured: Calibration) -> None:
    assert [(p.method, p.dimensions, p.converged) for p in measured.defaults] == [("auto", 2, True), ("auto", 3, True)]
    for point in measured.defaults:
        assert 0.0 < point.error < 2e-3  # the target, where none is given
        assert point.wall_time > 0.0
        assert point.n_u >= 9


def test_a_calibration_of_a_version_before_is_read(measured: Calibration) -> None:
    document = calibration.to_document(measured)
    del document["defaults"]
    assert calibration.from_document(document) == replace(measured, defaults=())


def test_the_table_says_what_its_stars_mean(measured: Calibration) -> None:
    lines = calibration.table(measured).splitlines()
    assert lines[-2:] == [f"* {calibration.STAR}", calibration.AUTO]
    assert sum(line.startswith("  auto") for line in lines) == 2
    starred = sum(line.startswith("* ") for line in lines[:-2])
    assert starred == sum(len(calibration.front_of(measured.of_dimensions(dimensions))) for dimensions in (2, 3))


def test_the_model_knows_every_number_of_coordinates_and_effect(measured: Calibration) -> None:
    assert set(measured.cost.rates) == {2, 3, 4}
    assert all(rates.iterations > 0 for rates in measured.cost.rates.values())
    assert set(measured.cost.effects) == {"friction", "obstacles", "plasticity", "self_contact"}
    assert all(factor >= 1.0 for factor in measured.cost.effects.values())
    assert set(measured.cost.estimates) == {"march", "spacetime"}


def test_what_is_stored_is_read_again(measured: Calibration, tmp_path: Path) -> None:
    path = measured.save(tmp_path / "deep" / "calibration.json")
    assert calibration.load(path) == measured
    assert [file.name for file in path.parent.iterdir()] == ["calibration.json"]
    assert measured.current
    assert not replace(measured, source="0" * 12).current
    assert not replace(measured, machine={**measured.machine, "processor": "another"}).current


def test_where_none_is_stored_there_is_none(measured: Calibration, tmp_path: Path) -> None:
    assert calibration.load(tmp_path / "calibration.json") is None
    path = measured.save(tmp_path / "calibration.json")
    path.write_text(path.read_text()[:-200])  # cut short
    assert calibration.load(path) is None
    path.write_text(json.dumps({**calibration.to_document(measured), "format": 0}))
    assert calibration.load(path) is None


def test_the_default_place_is_the_data_directory_of_the_service(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path))
    assert calibration.default_path() == tmp_path / "calibration.json"
    monkeypatch.delenv("DLO_DATA_DIR")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert calibration.default_path() == tmp_path / "dlo" / "calibration.json"


def test_a_calibration_tells_how_far_it_is_and_stops_when_asked() -> None:
    news: list[tuple[int, int]] = []
    with pytest.raises(Cancelled):
        calibrating.measure(
            repeats=1,
            on_progress=lambda done, total, what: news.append((done, total)),
            cancelled=lambda: len(news) >= 3,
        )
    assert [done for done, _ in news] == [0, 1, 2]
    assert all(total > 50 for _, total in news)

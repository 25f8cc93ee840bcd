"""A spline through what a vision system sees: in order or not, noisy, with outliers, 2D or 3D."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from app.schemas.fit import FitResponse
from dlocore import SceneError
from dlocore.shape.cloud import fit_cloud
from dlocore.shape.ordering import order_points, without_spikes
from tests.app.conftest import paper_scene
from tests.app.test_bad_requests import the_problem

FIT = "/v1/shapes:fit"


def sine(s: Any) -> np.ndarray:
    return np.column_stack([s, 0.15 * np.sin(2 * np.pi * s), np.zeros_like(s)])


def helix(s: Any) -> np.ndarray:
    return np.column_stack([0.1 * np.cos(9 * s), 0.1 * np.sin(9 * s), 0.3 * s])


FINE = np.linspace(0, 1, 5001)


def length_of(curve: Any) -> float:
    return float(np.sqrt((np.diff(curve(FINE), axis=0) ** 2).sum(axis=1)).sum())


def distance(found: dict[str, Any], curve: Any) -> float:
    """Return the largest distance between the fitted and the true curve, either way [m]."""
    u = np.linspace(0, found["length"], 2000)
    fitted = BSpline(found["knots"], np.array(found["control_points"]), found["degree"])(u)
    true = curve(FINE)
    return float(max(cKDTree(true).query(fitted)[0].max(), cKDTree(fitted).query(true)[0].max()))


def seen(curve: Any, count: int, noise: float, outliers: int, seed: int = 0) -> tuple[np.ndarray, set[int]]:
    """Return points of a curve in no order with outliers at least 0.1 m off it, and which these are."""
    rng = np.random.default_rng(seed)
    points = curve(np.linspace(0, 1, count)) + noise * rng.normal(size=(count, 3))
    tree = cKDTree(curve(FINE))
    far = [p for p in rng.uniform(-0.5, 1.5, (50 * (outliers + 1), 3)) if tree.query(p)[0] > 0.1][:outliers]
    mix = rng.permutation(count + outliers)
    return np.vstack([points, *far])[mix], set(np.flatnonzero(mix >= count).tolist())


def fitted(client: TestClient, points: np.ndarray, **options: Any) -> dict[str, Any]:
    response = client.post(FIT, json={"points": points.tolist(), **options})
    assert response.status_code == 200, response.text
    document: dict[str, Any] = response.json()
    FitResponse.model_validate(document)
    return document


@pytest.mark.parametrize("curve", [sine, helix])
@pytest.mark.parametrize(("count", "noise"), [(25, 0.0), (100, 0.002), (1000, 0.003), (5000, 0.004)])
def test_a_cloud_gives_the_curve_it_was_taken_from(client: TestClient, curve: Any, count: int, noise: float) -> None:
    points, outliers = seen(curve, count, noise, count // 20)
    found = fitted(client, points, ordered=False)
    assert outliers <= set(found["outliers"])
    assert len(found["outliers"]) <= len(outliers) + 0.05 * count  # points of the cable that noise put far off it
    # three deviations at the ends, where few points tell; up to 1.6 mm without noise, between points 40 mm apart
    assert distance(found, curve) < 0.003 + 4 * noise
    assert found["length"] == found["measured_length"] == pytest.approx(length_of(curve), rel=0.03)
    assert found["fit_error"]["rms"] == pytest.approx(
        1.41 * noise, rel=0.25, abs=1e-3
    )  # across the curve: two of three


def test_points_in_order_with_spikes_give_the_curve(client: TestClient) -> None:
    points = sine(np.linspace(0, 1, 60))
    points[[10, 35, 36]] += [[0, 0.3, 0], [0.2, -0.3, 0], [0, 0.4, 0.1]]
    found = fitted(client, points, length=length_of(sine))
    assert set(found["outliers"]) == {10, 35, 36}
    assert distance(found, sine) < 0.002
    assert found["length"] == pytest.approx(length_of(sine))
    kept = client.post(FIT, json={"points": points.tolist(), "outliers": "keep"}).json()
    assert kept.get("outliers", []) == []


def test_flat_points_stay_flat_and_the_start_is_where_it_is_said(client: TestClient) -> None:
    points = sine(np.linspace(0, 1, 40))[:, :2]
    mixed = points[np.random.default_rng(1).permutation(40)]
    forward = fitted(client, mixed, ordered=False)
    backward = fitted(client, mixed, ordered=False, start=[1.0, 0.0, 0.0])
    assert np.abs(np.array(forward["control_points"])[:, 2]).max() < 1e-12
    assert forward["order"] == backward["order"][::-1]
    np.testing.assert_allclose(forward["control_points"][0], [0, 0, 0], atol=2e-3)
    np.testing.assert_allclose(backward["control_points"][0], [1, 0, 0], atol=2e-3)
    np.testing.assert_allclose(mixed[forward["order"]], points, atol=0)


def test_the_curve_can_be_predicted_from(client: TestClient) -> None:
    found = fitted(client, sine(np.linspace(0, 1, 40)), length=length_of(sine))
    cable = {**paper_scene()["cable"], "length": found["length"]}
    response = client.post("/v1/predictions", json=paper_scene(cable=cable, shape=found["shape"]))
    assert response.status_code == 201, response.text


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({}, "points"),
        ({"points": [[0, 1e300], [1, 0], [2, 0], [3, 0]]}, "points[0][1]"),
        ({"points": [[0, 0]] * 3}, "points"),
        ({"points": [[0, 0]] * 5}, "points"),
        ({"points": [[0, 0]] * 5, "ordered": False}, "points"),
        ({"points": [[0, 0], [1, 0], [2, 0, 0], [3, 0]]}, "points[2]"),
        ({"points": [[0, 0], [1, 0], [2, None], [3, 0]]}, "points[2][1]"),
        ({"points": [[0, 0], [1, 0], [2, 0], [3, 0]], "length": 5}, "points"),
        ({"points": [[0, 0], [1, 0], [2, 0], [3, 0]], "start": [0, 0]}, "start"),
        ({"points": [[0, 0], [1, 0], [2, 0], [3, 0]], "ordered": "no"}, "ordered"),
        ({"points": [[i, 0] for i in range(20_001)], "ordered": False}, "points"),
    ],
    ids=range(11),
)
def test_points_of_no_cable_are_refused_by_name(client: TestClient, body: dict[str, Any], field: str) -> None:
    problem = the_problem(client.post(FIT, json=body), 422)
    assert [error["field"] for error in problem["errors"]] == [field]


@pytest.mark.parametrize("length", [None, 0.73])
def test_few_points_with_an_outlier_are_refused_with_no_length_but_the_given_one(length: float | None) -> None:
    points = [[0.68, 0.09], [0.47, -0.03], [0.24, 0.05], [0.02, 0.01], [0.13, 0.06], [0.36, -0.01], [0.58, 0.02]]
    with pytest.raises(SceneError) as error:
        fit_cloud([*points, [0.3, 0.6]], ordered=False, length=length)
    assert error.value.field == "points"
    assert error.value.given == "8 points, of which 1 would be left out"
    assert error.value.reason == "They show no single curve"


def test_points_of_another_length_than_the_cable_are_told_both(client: TestClient) -> None:
    points = sine(np.linspace(0, 1, 60))[np.random.default_rng(1).permutation(60)]
    problem = the_problem(client.post(FIT, json={"points": points.tolist(), "ordered": False, "length": 2.5}), 422)
    assert "The cable is 2.5 m long" in problem["detail"]
    assert "Got a curve 1.19" in problem["detail"]
    assert problem["errors"][0]["allowed"] == "points along the whole cable, or another length"


def test_a_cross_is_no_cable() -> None:
    s = np.linspace(-1, 1, 101)
    zero = np.zeros_like(s)
    cross = np.vstack([np.column_stack([s, zero, zero]), np.column_stack([zero, s, zero])])
    with pytest.raises(SceneError, match="no single curve"):
        order_points(cross)


def test_order_does_not_depend_on_the_order_given() -> None:
    points, _ = seen(sine, 200, 0.001, 10)
    one = order_points(points)
    mix = np.random.default_rng(5).permutation(len(points))
    other = order_points(points[mix])
    same = {tuple(p) for p in points[one.order]} & {tuple(p) for p in points[mix][other.order]}
    assert len(same) >= len(one.order) - 2
    assert np.all(np.diff(points[one.order][:, 0]) > -0.01)


def test_noise_is_no_spike() -> None:
    points = sine(np.linspace(0, 1, 300)) + 0.003 * np.random.default_rng(3).normal(size=(300, 3))
    assert len(without_spikes(points).outliers) <= 3


def test_a_fit_without_removal_keeps_every_point() -> None:
    points = sine(np.linspace(0, 1, 60)) + 0.002 * np.random.default_rng(3).normal(size=(60, 3))
    found = fit_cloud(points, remove_outliers=False)
    assert len(found.order) == 60
    assert found.curve.fit_max >= found.curve.fit_rms > 0

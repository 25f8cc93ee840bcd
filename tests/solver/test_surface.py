"""A surface is evaluated anywhere, in an order that suits its size."""

import tracemalloc
from typing import Any

import numpy as np
import pytest

import dlocore
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    effect_forces,
    energies,
    predict,
)
from dlocore.spline import SplineSurface, design_matrix, uniform_knots


def surface(n_u: int, n_t: int) -> SplineSurface:
    control = np.random.default_rng(n_u).normal(size=(n_t, n_u, 4))
    return SplineSurface(control, uniform_knots(n_u, 1.5), uniform_knots(n_t, 2.0))


@pytest.mark.parametrize("times", [5, 40], ids=["fewer times than control points", "more"])
@pytest.mark.parametrize(("du", "dt"), [(0, 0), (1, 0), (0, 1), (2, 1), (3, 3)])
def test_it_is_the_sum_of_products_of_the_bases(times: int, du: int, dt: int):
    q = surface(9, 20)
    u, t = np.linspace(0.0, 1.5, 31), np.linspace(0.0, 2.0, times)
    over_u, over_t = design_matrix(q.knots_u, u, du), design_matrix(q.knots_t, t, dt)
    expected = np.einsum("ui,tj,jic->tuc", over_u, over_t, q.control_points)
    np.testing.assert_allclose(q(u, t, du, dt), expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(q(u[3], t[2], du, dt).shape, (1, 1, 4))
    expected = np.einsum("tj,jic->tic", over_t, q.control_points)
    np.testing.assert_allclose(q.states(t, dt), expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_a_long_motion_is_read_at_every_step_in_little_memory():
    """96:4306 has 9,728 control points in time and 477,920 steps: a matrix of both would have had 37 GB."""
    q, t = surface(9, 4000), np.linspace(0.0, 2.0, 100_000)
    tracemalloc.start()
    found = q([0.7], t, dt=1)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found.shape == (100_000, 1, 4)
    assert most < 10 * found.nbytes


@pytest.mark.parametrize(("u", "given"), [([250.0], "250.0"), ([0.3, -0.01, 0.5], "-0.01"), ([np.nan], "nan")])
def test_a_place_off_the_cable_is_refused_by_its_value(u: list[float], given: str):
    for read in (surface(9, 20).positions, surface(9, 20).axial_strain):
        with pytest.raises(SceneError) as caught:
            read(u, [0.5])
        assert (caught.value.field, caught.value.given) == ("u", given)
        assert caught.value.allowed == "finite numbers at least 0 at most 1.5 [m]"


@pytest.mark.parametrize(
    "u", ["0.5", ["0.5"], True, [True], None, [[0.1], [0.1, 0.2]], np.ma.masked_array([0.1, 0.5], mask=[False, True])]
)
def test_what_is_no_number_is_no_place(u: Any):
    with pytest.raises(SceneError, match="finite numbers") as caught:
        surface(9, 20).positions(u, [0.5])
    assert caught.value.field == "u"


@pytest.mark.parametrize("times", [1, 40], ids=["fewer times than control points", "more"])
@pytest.mark.parametrize("t", [-0.1, 2.1, np.inf])
def test_a_time_outside_the_predicted_time_is_refused_by_its_value(t: float, times: int):
    for read in (lambda t: surface(9, 20)([0.5], t), surface(9, 20).states):
        with pytest.raises(SceneError) as caught:
            read(np.full(times, t))
        assert (caught.value.field, caught.value.given) == ("t", repr(t))
        assert caught.value.allowed == "finite numbers at least 0 at most 2 [s]"


@pytest.mark.parametrize("order", [-1, 4, 1.0, "1", True])
def test_a_derivative_that_a_cubic_does_not_have_is_refused(order: int):
    q = surface(9, 20)
    for name in ("du", "dt"):
        with pytest.raises(SceneError, match="0 to 3") as caught:
            q([0.5], [0.5], **{name: order})
        assert caught.value.field == name
    with pytest.raises(SceneError, match="dt: got"):
        q.states([0.5], order)


@pytest.mark.parametrize("u", [["a"], [None, "b"], [[0.1], [0.2, 0.3]]])
def test_what_is_no_place_is_refused_by_its_value(u: list[object]):
    with pytest.raises(SceneError, match="u: got "):
        surface(9, 20)(u, [0.5])


@pytest.mark.parametrize(
    ("name", "count"), [("samples_u", 0), ("samples_t", -1), ("samples_u", 2.5), ("samples_t", "9")]
)
def test_a_number_of_samples_that_is_none_is_refused(name: str, count: object):
    with pytest.raises(SceneError, match=f"{name}: got .* Allowed: an integer, 1 to 1000000"):
        surface(9, 20).sample(**{name: count})


def test_the_ends_are_read_with_their_rounding():
    q = surface(9, 20)
    ends = q([0.0, 1.5], [0.0, 2.0])
    beyond = q([-1e-12, 1.5 * (1.0 + 1e-12)], [-1e-12, 2.0 * (1.0 + 1e-12)])
    np.testing.assert_allclose(beyond, ends, rtol=0.0, atol=1e-9)
    assert q([], [0.5]).shape == (1, 0, 4)


def test_what_reads_a_motion_refuses_other_times_places_and_cables():
    def scene(length: float) -> Scene:
        return Scene(
            cable=Cable.preset("paper", length=length),
            shape=Straight(),
            grasps=[Grasp(u=0.25, path=Move(displacement=(0.0, 0.1, 0.0), duration=1.0))],
            environment=Environment(table=Table()),
            quality=Quality(n_u=9, n_t=13, estimate=False),
        )

    found = predict(scene(1.0))
    for read in (energies, effect_forces):
        for t in (-3.0, 50.0, np.nan):
            with pytest.raises(SceneError, match="times: got"):
                read(found.scene, found.surface, [t])
        with pytest.raises(SceneError, match="surface: got that of a cable of 1 m"):
            read(scene(2.0), found.surface, [0.0])
    with pytest.raises(SceneError, match="surface: got <Prediction"):
        energies(found.scene, found, [0.0])
    for u, t in ((2.0, 0.5), (-1.0, 0.5), (0.5, 50.0), (0.5, np.nan)):
        with pytest.raises(SceneError, match=r"[ut]: got"):
            found.stretch.along(u, t)
    for t in (-1.0, 50.0, np.nan, [], [0.1, 0.2]):
        with pytest.raises(SceneError, match="t: got"):
            found.stretch.at(t)
    assert found.stretch.along(0.5, 0.5) == found.stretch.along([0.5], [0.5])
    for strain in (found.stretch.along, found.surface.axial_strain):
        assert strain([0.1, 0.2], []).shape == found.surface([0.1, 0.2], [])[..., 0].shape == (0, 2)
        assert strain([], [0.1]).shape == (1, 0)
    for read in (found.surface, found.surface.axial_strain, found.stretch.along):
        for u, t, name in (([[0.1, 0.2]], [0.5], "u"), ([0.1], [[0.5]], "t")):
            with pytest.raises(SceneError, match=rf"^{name}: got shape .*Allowed: one row of finite numbers"):
                read(u, t)
    for read in (energies, effect_forces):
        with pytest.raises(SceneError, match=r"^times: got shape \(1, 2\)"):
            read(found.scene, found.surface, [[0.1, 0.2]])


def test_completion_knows_what_is_imported_on_first_use():
    assert set(dlocore.__all__) == set(dir(dlocore))
    assert all(hasattr(dlocore, name) for name in dir(dlocore))

"""The error estimate is the sum of its parts, whatever the method."""

from dataclasses import replace

import pytest

from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict

SCENE = Scene(
    cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3),
    shape=Straight(),
    grasps=(Grasp(u=0.25, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6)),),
    environment=Environment(drag=0.05, table=Table()),
)
SLOW = replace(
    SCENE, grasps=(Grasp(u=0.25, path=Move(displacement=(0.0, 0.1, 0.0), duration=400.0)),),
    environment=Environment(drag=0.05, table=Table(friction=0.3)),
)  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "quality", "names"),
    [
        (SCENE, Quality(), {"grid", "iteration", "neglected"}),
        (SCENE, Quality(target_error=5e-6), {"space", "time", "iteration", "neglected"}),
        (SCENE, Quality(time_budget=0.5), None),
        (SCENE, Quality(n_u=9, n_t=13, method="march"), {"grid", "iteration", "neglected"}),
        (SCENE, Quality(n_u=9, n_t=13, method="spacetime"), {"grid", "iteration", "neglected"}),
        (SCENE, Quality(method="reference", target_error=0.02), {"grid", "time"}),
        (SLOW, Quality(n_u=13, n_t=19, method="march"), {"grid", "iteration", "neglected"}),
    ],
)
def test_the_estimate_is_the_sum_of_its_parts(scene: Scene, quality: Quality, names: set[str] | None):
    accuracy = predict(replace(scene, quality=quality)).accuracy
    assert accuracy.error_estimate is not None
    assert accuracy.error_estimate == pytest.approx(sum(accuracy.error_parts.values()), rel=1e-12)  # rounding
    assert all(size >= 0.0 for size in accuracy.error_parts.values())
    if names is not None:
        assert set(accuracy.error_parts) == names
    assert accuracy.error_parts.get("neglected", 0.0) == accuracy.neglected
    largest = max(accuracy.error_parts.values())
    assert largest > 0.2 * accuracy.error_estimate


def test_what_auto_leaves_out_has_its_part():
    accuracy = predict(replace(SLOW, quality=Quality(n_u=13, n_t=19, method="march"))).accuracy
    assert accuracy.error_parts["neglected"] > 0.0


def test_an_unknown_error_has_no_parts():
    accuracy = predict(replace(SCENE, quality=Quality(n_u=9, n_t=13, method="spacetime", estimate=False))).accuracy
    assert accuracy.error_estimate is None
    assert accuracy.error_parts == {}


@pytest.mark.parametrize(("duration", "target"), [(1000.0, 1e-5), (600.0, 5e-5), (400.0, 1e-3), (1000.0, 1e-3)])
def test_a_target_is_met_with_the_inertia_that_is_left_out_or_it_is_not_left_out(duration, target):
    way = Move(displacement=(0.0, 0.3, 0.0), duration=duration)
    slow = replace(SCENE, grasps=(Grasp(u=0.0, path=way),), horizon=duration, quality=Quality(target_error=target))
    found = predict(slow)
    assert found.status == "converged"
    assert found.accuracy.error_estimate <= target
    told = found.accuracy.error_estimate - found.accuracy.error_parts["iteration"]  # of the grids, and what is left out
    assert f"the estimated error is {told * 1e3:.3g} mm" in found.message

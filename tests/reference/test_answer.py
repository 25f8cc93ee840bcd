"""The reference as a method of `predict`: its error estimate, its answer, and how it ends early."""

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlocore.reference
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    predict,
)
from dlocore.errors import Cancelled
from dlocore.levels.whole_march import sided
from dlocore.problem.problem import pose
from dlocore.reference import refine
from dlocore.reference.compile import _FILES
from dlocore.reference.fit import fit
from dlocore.reference.motion import Motion, Watch
from dlocore.reference.refine import left
from dlocore.reference.rod import Rod, build
from dlocore.reference.solve import UNTESTED, converged
from dlocore.solvers.monitor import Monitor
from dlocore.stability.determined import DISTURBED, UNDETERMINED
from tests.reference.rods import cable
from tests.solver.scenes import arch_with_feet_close_for
from tests.solver.test_again import pushed as pushed_along_itself

GRASP = Grasp(u=0.25, path=Move(displacement=(0.0, 0.3, 0.0), duration=0.8))
SCENE = Scene(
    cable=cable(),
    shape=Straight(),
    grasps=(GRASP,),
    environment=Environment(gravity=(0, 0, 0), drag=0.1),
    quality=Quality(method="reference"),
)

# what it may take from the rest: data, the posed scene, the classes of the answer, the clock, and how to compile
DATA = (
    "errors.", "words.", "spline.", "scene.", "shape.", "answer.parts.", "prediction.", "compiling.",
    "solvers.monitor.", "problem.buckling.", "problem.events.", "problem.notes.", "problem.plane.", "problem.problem.",
)  # fmt: skip
# and what the other methods decide for it, as docs/reference.md says
DECISIONS = {
    "levels.whole_march.sided", "levels.driven.beside", "statics.tipping.may_fall", "statics.tipping.to_a_side",
    "statics.tipping.tip_notes", "stability.determined.DISTURBED", "stability.determined.UNDETERMINED",
    "stability.determined.farther", "stability.determined.in_words",
}  # fmt: skip
PACKAGE = Path(dlocore.reference.__file__).parent


def target(error):
    return replace(SCENE, quality=Quality(method="reference", target_error=error))


def imported(path: Path) -> set[str]:
    """Return the names of all that a file imports from the package: modules, and what is in them."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return {name.removeprefix("dlocore.") for name in found if name.startswith("dlocore.")}


def test_it_shares_no_solver_code_with_what_it_judges():
    taken = {name for path in PACKAGE.glob("*.py") for name in imported(path)}
    assert {name for name in taken if not f"{name}.".startswith((*DATA, "reference."))} == DECISIONS


def test_the_cache_depends_on_every_file_that_is_compiled_or_read_by_compiled_code():
    within = {
        path.stem: [n.split(".")[1] for n in imported(path) if n.startswith("reference.")]
        for path in PACKAGE.glob("*.py")
    }
    compiled = {file for file, read in within.items() if "compile" in read}
    assert compiled | {read for file in compiled for read in within[file]} == set(_FILES)


def test_the_estimate_bounds_the_error_and_the_target_is_met():
    loose, tight = converged(SCENE, 1e-3), converged(SCENE, 1e-4)
    stride = (len(tight.u) - 1) // (len(loose.u) - 1)
    error = np.linalg.norm(loose.positions - tight.positions[:, ::stride], axis=-1).max()
    assert loose.tolerance_met
    assert tight.tolerance_met
    assert error < loose.error_estimate + tight.error_estimate < 1.1e-3


@pytest.mark.parametrize(
    ("before", "change", "expected"),
    [
        (4e-3, 2e-3, 2e-3),
        (4e-3, 1e-3, 1e-3 / 3.0),
        (6e-3, 1e-3, 1e-3 / 3.0),
        (3e-3, 2.5e-3, 5e-3),
        (155e-3, 19.1e-3, 38.2e-3),  # 35:63: the next rod moved it by 335 mm
        (155e-3, 1e-3, 7.75e-3),
        (0.0, 0.0, 0.0),
    ],
    ids=["first order", "second order", "faster", "hardly", "of no order", "by chance", "at rest"],
)
def test_what_is_left_of_changes_is_that_of_the_second_order_at_best(before, change, expected):
    assert left(before, change) == pytest.approx(expected)


def test_the_surface_is_the_motion_of_the_rods():
    prediction = predict(SCENE)
    rods = converged(SCENE, 1e-3)
    assert prediction.status == "converged"
    assert prediction.accuracy.method == "reference"
    assert prediction.accuracy.error_estimate < 1.2e-3  # the rods' 1e-3 at most, and the fit
    np.testing.assert_allclose(prediction.surface.positions(rods.u, rods.t), rods.positions, atol=2e-4)  # of the fit
    assert [i.n_u for i in prediction.iterations] == sorted(i.n_u for i in prediction.iterations)
    assert prediction.iterations[0].update == np.inf
    assert prediction.iterations[-1].update < prediction.iterations[-2].update
    assert prediction.iterations[-1].energy > 0.0
    assert prediction.start_energy == pytest.approx(0.0, abs=1e-12)
    assert prediction.material is None
    active = {e.name for e in prediction.effects if e.active}
    assert {"inertia", "drag", "stretch", "bend"} <= active
    assert "twist" not in active
    force = prediction.grasps[0]
    assert force.reaction.shape == (len(force.times), 3)


@pytest.mark.parametrize("u", [0.0, 1.0])
def test_the_stretch_goes_to_both_ends_as_the_gripper_pulls(u: float):
    sideways = Move(displacement=(0.2, 0.0, 0.0), duration=0.8)
    hangs = Straight(direction=(0.0, 0.0, 2.0 * u - 1.0), settle=True)
    around, undamped = Environment(drag=0.1), cable(axial_damping=0.0)
    held = Grasp(u=u, path=sideways)
    found = predict(replace(SCENE, cable=undamped, shape=hangs, grasps=(held,), environment=around))
    t = found.stretch.times
    assert found.stretch.u[0] == 0.0
    assert found.stretch.u[-1] == 1.0
    tension = found.scene.cable.axial_stiffness * found.stretch.along([u, 1.0 - u], t)
    tangents = found.surface([u], t, du=1)[:, 0, :3]
    outward = (2.0 * u - 1.0) * tangents / np.linalg.norm(tangents, axis=1)[:, None]
    (gripper,) = found.grasps
    pull = np.column_stack([np.interp(t, gripper.times, gripper.reaction[:, d]) for d in range(3)])
    np.testing.assert_allclose(tension[:, 0], (pull * outward).sum(axis=1), rtol=1e-3)
    np.testing.assert_allclose(tension[:, 1], 0.0, atol=1e-3)


def test_the_surface_keeps_what_a_gripper_holds_at_both_ends():
    surface = predict(target(5e-3)).surface
    held = surface.positions([GRASP.u], [0.0, surface.horizon])[:, 0]
    np.testing.assert_allclose(held, [[0.25, 0.0, 0.0], [0.25, 0.3, 0.0]], rtol=0.0, atol=1e-9)


def test_its_end_is_the_start_of_another_motion():
    first = predict(SCENE)
    on = replace(SCENE, shape=first.shape_at(), grasps=(), horizon=0.1)
    second = predict(on)
    u = np.linspace(0.0, 1.0, 11)
    # the start is brought to unit stretch; it stores 1e-4 of strain
    np.testing.assert_allclose(second.surface.positions(u, [0.0]), first.surface.positions(u, [0.8]), atol=5e-4)
    rates = [p.surface(u, [t], dt=1)[..., :3] for p, t in ((second, 0.0), (first, 0.8))]
    np.testing.assert_allclose(*rates, atol=0.02)  # [m/s], of the fit in time


def test_sections_turn_with_a_clamp_and_remember():
    turn = Move(displacement=(0.0, 0.0, 0.0), duration=1.0, rotation=(12.0, 0.0, 0.0))
    bow = np.column_stack([np.sin(np.linspace(0, 1, 30)), 1 - np.cos(np.linspace(0, 1, 30)), np.zeros(30)])
    scene = Scene(
        cable=cable(torsional_damping=1e-5, rest_shape="initial"),
        shape=Points(points=bow),
        grasps=(Grasp(u=0.0, hold="clamp", path=turn),),
        environment=Environment(gravity=(0, 0, 0), drag=0.5),
        quality=Quality(method="reference", target_error=0.02),
    )
    prediction = predict(scene)
    # the clamp turns about the tangent there, so the section turns by 12 rad, nearly two turns
    theta = prediction.surface(np.array([0.0]), np.array([0.0, 1.0]))[:, 0, 3]
    assert theta[1] - theta[0] == pytest.approx(12.0, abs=0.05)  # held at u = 0, where theta lies on the edge beside it
    material = prediction.material
    assert material is not None
    np.testing.assert_allclose(np.linalg.norm(material.memory[-1, :, :2], axis=1), 1.0, atol=0.05)  # of the fitted bow


@pytest.mark.parametrize(
    ("wrong", "field"),
    [
        ({"effects": {"inertia": "off"}}, "effects.inertia"),
        ({"effects": {"self_contact": "on"}}, "effects.self_contact"),
    ],
)
def test_what_it_does_not_simulate_is_refused_by_name(wrong, field):
    with pytest.raises(SceneError) as refused:
        predict(replace(SCENE, **wrong))
    assert refused.value.field == field


def test_strands_that_meet_are_refused_and_switched_off_pass():
    phi = np.linspace(-0.6, 2 * np.pi + 0.6, 121)
    loop = 0.1 * np.column_stack([np.sin(phi), -np.cos(phi), 0.05 * (phi - np.pi)])
    length = float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum())
    down = Move(displacement=(0.0, 0.0, -0.08), duration=0.4)
    scene = Scene(
        cable=cable(length=length, diameter=0.005),
        shape=Points(points=loop),
        grasps=(Grasp(u=0.0), Grasp(u=length, path=down)),
        environment=Environment(gravity=(0, 0, 0), drag=0.2),
        quality=Quality(method="reference", target_error=0.05),
        effects={"self_contact": "off"},
    )
    assert predict(scene).status == "converged"
    with pytest.raises(SceneError) as refused:
        predict(replace(scene, effects={}))
    assert refused.value.field == "effects.self_contact"


@pytest.mark.parametrize("quality", [{"n_u": 9, "n_t": 13}, {"time_budget": 0.1}])
def test_it_takes_no_grid_and_no_budget(quality):
    with pytest.raises(SceneError, match="reference"):
        Quality(method="reference", **quality)


def test_out_of_time_it_answers_with_the_best_it_has():
    prediction = predict(target(1e-6), deadline=1e-9)
    assert prediction.status == "time_limit"
    assert prediction.accuracy.error_estimate is None
    assert "stands still" in prediction.message


def test_cancelled_it_stops():
    with pytest.raises(Cancelled):
        predict(SCENE, cancelled=lambda: True)


def test_contact_is_stiffened_until_the_table_is_hardly_entered():
    made = Cable.preset("paper", bending_damping=1e-4)
    scene = Scene(
        cable=made,
        shape=Straight(start=(0, 0, 0.03)),
        environment=Environment(drag=0.05, table=Table(friction=0.3)),
        horizon=0.15,
        quality=Quality(method="reference", target_error=0.002),
    )
    prediction = predict(scene)
    assert prediction.surface.positions(np.linspace(0, 1, 41), np.linspace(0, 0.15, 41))[..., 2].min() > -0.1 * 0.005


def rod_pushed_along_itself(shortened: float) -> Scene:
    """Return a nearly straight rod on a table: a micrometre decides to which side it buckles."""
    return replace(pushed_along_itself(shortened), quality=Quality(method="reference", target_error=1e-2))


@pytest.fixture(scope="module")
def pushed() -> Scene:
    return rod_pushed_along_itself(1e-3)


def first_of(status: str) -> Prediction:
    """Return the first answer with a status of such rods: whether two of them agree is a matter of the processor."""
    found = []
    for shortened in (1e-3, 2e-3):
        found.append(predict(rod_pushed_along_itself(shortened)))
        if found[-1].status == status:
            return found[-1]
    raise AssertionError([answer.message for answer in found])


def test_a_scene_that_does_not_determine_its_motion_is_no_success():
    found = first_of("stalled")
    told = "But the scene does not determine its motion: bending the start by a millionth of the length"
    assert told in found.message
    assert found.accuracy.error_parts["start"] > UNDETERMINED
    assert found.accuracy.error_estimate == pytest.approx(sum(found.accuracy.error_parts.values()))


def test_nor_is_one_that_is_unstable_midway_and_has_forgotten_its_start():
    found = predict(replace(arch_with_feet_close_for(10.0), quality=Quality(method="reference", target_error=2e-2)))
    assert found.status == "stalled"
    assert found.accuracy.error_parts["start"] > 0.1


def test_where_no_time_is_left_to_see_that_the_answer_says_so(monkeypatch: pytest.MonkeyPatch):
    plain = refine.simulate

    def late(rod: Rod, tolerance: float, watch: Watch, bend: Any = None) -> Motion:
        motion = plain(rod, tolerance, watch)
        return motion if bend is None else replace(motion, stopped="time")

    monkeypatch.setattr(refine, "simulate", late)
    found = first_of("converged")
    assert UNTESTED in found.message
    assert "start" not in found.accuracy.error_parts


@pytest.mark.parametrize(
    ("moves", "ways", "moved"),
    [
        ((0.0005,), "+", 0.0),
        ((0.005, 0.005), "+-", 0.0),
        ((0.5, 0.5), "++", 0.5),
        ((0.005, 0.5, 0.005, 0.5), "+-+-", 0.5),
        ((0.5, 0.005, 0.005), "++-", 0.0),
    ],
)
def test_it_is_bent_the_other_way_where_the_first_is_in_doubt_and_the_finest_rod_decides(
    moves: tuple[float, ...], ways: str, moved: float, pushed: Scene, monkeypatch: pytest.MonkeyPatch
):
    refined = refine.refine(pose(replace(pushed, horizon=0.1)), 1.0, Monitor(), lambda problem, level: None)
    left, seen = list(moves), ""

    def bent(rod: Rod, tolerance: float, watch: Watch, bend: Any) -> Motion:
        nonlocal seen
        motion = next(level.motion for level in refined.levels if level.motion.rod is rod)
        seen += "+" if np.array_equal(bend(rod.start.x), refine.bend_of(rod, rod.start.x)) else "-"
        away = np.array([0.0, left.pop(0), 0.0])
        return replace(motion, states=tuple(replace(s, x=s.x + away) for s in motion.states))

    monkeypatch.setattr(refine, "simulate", bent)
    assert refine.goes_astray(refined, 1.0, Monitor()) == pytest.approx(moved)
    assert seen == ways


def test_a_bend_leaves_what_holds_it(pushed: Scene):
    rod = build(pose(pushed), np.linspace(0.0, 1.0, 21))
    bend = refine.bend_of(rod, rod.start.x)
    assert np.linalg.norm(bend, axis=1).max() == pytest.approx(DISTURBED)
    assert not bend[[0, -1]].any()
    assert not bend[:, 2].any()
    assert np.abs(bend[:, 0]).max() < 1e-10


def test_a_spline_that_misses_the_rods_by_more_than_the_target_is_not_called_converged(monkeypatch):
    monkeypatch.setattr("dlocore.reference.solve.fit", lambda *given: replace(fit(*given), missed=2e-3))
    monkeypatch.setattr(refine, "LEVELS", refine.LEAST)
    found = predict(target(2e-3))
    assert found.status == "max_iterations"
    assert "misses them by 2 mm" in found.message


def test_rods_that_agree_are_refined_until_the_spline_through_them_is_near_enough():
    sharp = Scene(  # the cable bends sharply at its middle grasp, where the spline of 80 elements misses it by 1.7 mm
        cable=Cable(length=5.0, diameter=0.01, linear_density=0.12, bending_stiffness=0.02),
        shape=Straight(start=(0.0, 0.0, 2.0), settle=True),
        grasps=(
            Grasp(u=0.0, path=Move(displacement=(0.5, 0.0, 0.0), duration=2.0)),
            Grasp(u=2.5, path=Move(displacement=(0.0, 0.6, 0.2), duration=2.0)),
            Grasp(u=5.0, path=Move(displacement=(-0.6, 0.0, 0.0), duration=2.0)),
        ),
        environment=Environment(drag=0.1),
        quality=Quality(method="reference", target_error=0.005),
    )
    found = predict(sharp)
    assert found.status == "converged"
    assert found.accuracy.error_estimate <= 0.005


def test_a_tap_early_in_a_long_time_is_shown_within_the_target():
    tap = Load(u=1.0, force=[(0, 0, 0), (0, 0, 0), (0, 1, 0), (0, 0, 0)], times=[0, 0.3, 0.35, 0.4])
    scene = Scene(
        cable=Cable.preset("paper"),
        shape=Straight(),
        grasps=(Grasp(u=0.0),),
        loads=(tap,),
        environment=Environment(drag=0.3, table=Table()),
        horizon=20.0,
        quality=Quality(method="reference", target_error=6e-3),
    )
    found = predict(scene)
    assert found.status == "converged", found.message
    assert found.accuracy.error_parts["time"] < 1e-3


def test_a_motion_that_bends_a_cable_for_good_is_looked_at_for_whether_it_leaves_its_plane():
    # its bends turn over with the sections: planar rods were `converged`, 64 mm from where a cable on its side goes
    scene = Scene(
        cable=Cable.preset("paper", bending_stiffness=1e-2, axial_stiffness=None, yield_strain=0.005, memory_rate=50.0),
        shape=Straight(),
        grasps=(Grasp(u=0.5, path=Move(displacement=(0.0, 0.4, 0.0), duration=0.6)),),
        environment=Environment(drag=0.1, table=Table()),
        horizon=1.2,
    )
    assert "side" in sided(pose(scene), Monitor()).called_for
    assert "side" not in sided(pose(replace(scene, effects={"plasticity": "off"})), Monitor()).called_for

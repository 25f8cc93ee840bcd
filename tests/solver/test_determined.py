"""Scenes that do not determine their motion: what their answers say, and what finds them out."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import Cable, Cancelled, Environment, Grasp, Move, Points, Quality, Scene, Straight, Table, predict
from dlocore.accuracy import doubts, refinement
from dlocore.accuracy.budget import Means
from dlocore.answer.parts import Status
from dlocore.kernels.growth import fastest_growth
from dlocore.levels.whole_march import march_level
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, hold
from dlocore.problem.problem import pose
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.stability import determined
from dlocore.stability.determined import DISTURBED, DOUBTFUL, UNDETERMINED, UNSEEN, bent, goes_astray, may_grow
from dlocore.statics.statics import start_grid
from tests.solver.scenes import WEIGHTLESS, arch_with_feet_close_for

LENGTH = 1.0
EI, MU = 0.02, 0.1  # [N m^2], [kg/m]


def column(shortened: float, drag: float = 0.0, flat: bool = False) -> Scene:
    """Return a rod with a bow of a thousandth, pinned at its ends, which come nearer by a part of its length.

    A `flat` one can't leave its plane, in which a bow makes an arch of it, and has one of a millionth.
    """
    u = np.linspace(0.0, LENGTH, 41)
    bow = (1e-6 if flat else 1e-3) * LENGTH * np.sin(np.pi * u / LENGTH)
    points = np.column_stack([u, bow, 0.0 * bow if flat else 0.3 * bow])
    return Scene(
        cable=Cable(length=LENGTH, diameter=0.01, linear_density=MU, bending_stiffness=EI, axial_stiffness=1e5),
        shape=Points(points=points),
        grasps=(Grasp(u=0.0), Grasp(u=LENGTH, path=Move(displacement=(-shortened, 0.0, 0.0), duration=1.0))),
        environment=dataclasses.replace(WEIGHTLESS, drag=drag),
        effects={} if flat else {"twist": "on"},
        horizon=1.0,
    )


@pytest.fixture
def again(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Steps of each march that was asked for to look whether a motion is determined."""
    steps: list[int] = []

    def march_again(*arguments: Any, **options: Any) -> Any:
        steps.append(arguments[2])
        return march(*arguments, **options)

    monkeypatch.setattr(determined, "march", march_again)
    return steps


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("drag", [0.0, 3.0])
def test_a_column_under_twice_its_critical_load_grows_as_beam_theory_says(drag: float, flat: bool):
    scene = column(0.0, drag, flat)
    problem = pose(scene)
    assert problem.nc == (2 if flat else 4)
    grid = start_grid(problem, 41, Monitor(None, None))
    critical = EI * (np.pi / LENGTH) ** 2
    squeezed = grid.start.copy()
    x = problem.world(squeezed)[:, 0]
    strain = 2.0 * critical / 1e5
    along = problem.world(np.eye(problem.nc)[:1]) - problem.world(np.zeros((1, problem.nc)))
    assert abs(along[0, 0]) == pytest.approx(1.0, abs=1e-2)
    squeezed[:, 0] -= strain * x * np.sign(along[0, 0])
    grasps, starts = closed_grasps(scene, 0.0, 1.0), Starts()
    close_grasps(problem, grid, grasps, starts, grid.start)
    held = hold(problem, grid, grasps, np.array([0.0]), starts, grid.start)
    past = grid.past()
    history = past._replace(memory=past.memory[None], past=past.past[None], axial=past.axial[None])

    def fastest(slowest: float) -> float:
        states = squeezed[None], np.zeros_like(squeezed[None])
        laws = (problem.mass_density(), problem.drag_coefficient(), held.elimination, slowest)
        return float(fastest_growth(problem.axes, *states, history, grid.tables, *problem.laws, *laws)[0])

    # mu s^2 + drag s = (P - P_c) (pi/L)^2 of the first mode
    load = critical * (np.pi / LENGTH) ** 2
    rate = (math.sqrt(drag**2 + 4.0 * MU * load) - drag) / (2.0 * MU)
    assert fastest(1.03 * rate) == 0.0
    assert fastest(0.97 * rate) == pytest.approx(2.0 * 0.97 * rate)
    assert rate < fastest(0.1 * rate) <= 2.0 * rate


def test_a_motion_with_events_is_marched_again_in_the_same_steps(monkeypatch: pytest.MonkeyPatch):
    """Stretches between events that lie close have more steps than their share: of 8 at least."""
    answer = predict(draw(90, 47209).make())
    assert answer.level is not None
    problem, motion = answer.level.problem, answer.level.motion
    assert motion.asked < motion.steps
    monkeypatch.setattr(determined, "may_grow", lambda *_: True)  # else a rounding decides whether it is marched again
    moved = goes_astray(problem, motion, Monitor(None, None), hard=True)
    assert 0.0 < moved < UNDETERMINED * problem.scene.cable.length


def test_a_motion_that_is_pulled_straight_is_not_looked_at_again(monkeypatch: pytest.MonkeyPatch):
    scene = dataclasses.replace(column(-1e-4), environment=Environment(drag=1.0))
    answer = predict(scene)
    assert answer.status == "converged"
    assert answer.level is not None
    assert not may_grow(answer.level.problem, answer.level.motion)
    monkeypatch.setattr(determined, "march", None)  # none is needed
    assert goes_astray(answer.level.problem, answer.level.motion, Monitor(None, None), hard=True) == 0.0


@pytest.mark.parametrize(
    ("moves", "moved"),
    [((0.0005,), 0.0005), ((0.005, 0.002), 0.005), ((0.005, 0.5), 0.5), ((0.5,), 0.5)],
)
def test_where_a_bend_leaves_it_in_doubt_the_opposite_one_is_tried(
    moves: tuple[float, ...], moved: float, monkeypatch: pytest.MonkeyPatch
):
    answer = predict(dataclasses.replace(column(-1e-4), environment=Environment(drag=1.0)))
    assert answer.level is not None
    problem, motion = answer.level.problem, answer.level.motion
    left, bends = list(moves), []

    def bent_motion(problem: object, grid: Grid, *_: object, **__: object) -> March:
        bends.append(grid.start - motion.grid.start)
        return dataclasses.replace(motion, states=motion.states + np.array([0.0, left.pop(0), 0.0, 0.0]))

    monkeypatch.setattr(determined, "may_grow", lambda *_: True)
    monkeypatch.setattr(determined, "march", bent_motion)
    assert goes_astray(problem, motion, Monitor(), hard=False) == pytest.approx(moved)
    assert not left
    np.testing.assert_allclose(bends[-1], bends[0] * (-1.0) ** (len(bends) - 1), atol=1e-15)


def drawn_over_a_table(friction: float) -> Scene:
    """Return a straight cable on a table, which is drawn sideways at a quarter."""
    pulled = Grasp(u=0.25, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6))
    table = Environment(drag=0.05, table=Table(friction=friction))
    return Scene(cable=Cable.preset("paper"), shape=Straight(), grasps=(pulled,), environment=table)


@pytest.mark.parametrize("dimensions", [2, 3])
def test_what_a_march_in_one_call_says_of_its_growth_is_what_its_states_say(dimensions: int):
    pushed = dataclasses.replace(column(0.005, drag=3.0), effects={"twist": "off"})
    answer = predict(drawn_over_a_table(0.0) if dimensions == 2 else pushed)
    assert answer.level is not None
    problem, motion = answer.level.problem, answer.level.motion
    assert problem.nc == dimensions
    assert motion.growth is not None
    assert motion.growth > 0.0
    found = may_grow(problem, motion)
    (times, rates), *others = determined._rates(problem, motion)
    assert not others
    assert rates.mean() * (times[-1] - times[0]) == pytest.approx(motion.growth, rel=1e-12)
    assert may_grow(problem, dataclasses.replace(motion, growth=None)) == found


@pytest.mark.parametrize(("height", "marched"), [(0.0, False), (1e-6, True), (1e-3, False)])
def test_a_start_that_is_hardly_bent_is_bent_once_more(height: float, marched: bool, again: list[int]):
    u = np.linspace(0.0, LENGTH, 41)
    points = np.column_stack([u, height * np.sin(np.pi * u), 0.0 * u])
    answer = predict(dataclasses.replace(drawn_over_a_table(0.0), shape=Points(points=points)))
    assert answer.level is not None
    again.clear()
    moved = goes_astray(answer.level.problem, answer.level.motion, Monitor(None, None), hard=False)
    assert bool(again) == marched
    assert moved < 1e-4 * LENGTH  # it has grown by less than a hundredfold


def test_what_touches_is_marched_again_where_it_needed_more_than_the_first_grids(again: list[int]):
    """Tangents know nothing of where friction lets go."""
    answer = predict(drawn_over_a_table(0.3))
    assert answer.level is not None
    problem, motion = answer.level.problem, answer.level.motion
    assert problem.touches
    assert not motion.split
    assert not may_grow(problem, motion)
    assert goes_astray(problem, motion, Monitor(None, None), hard=False) == 0.0
    assert not again
    moved = goes_astray(problem, motion, Monitor(None, None), hard=True)
    assert 0.0 < moved < UNDETERMINED * problem.scene.cable.length
    assert again == [motion.asked]


@pytest.mark.parametrize(("index", "target"), [(42943, None), (20480, None), (39792, None), (45737, 0.02)])
def test_in_the_plane_too_a_scene_that_does_not_determine_its_motion_is_no_success(index: int, target: float | None):
    """Growth tells of the first; the next two start nearly straight; the last one slides on a rough table."""
    scene = draw(90, index).make()
    if target is not None:
        scene = dataclasses.replace(scene, quality=Quality(target_error=target * scene.cable.length))
    # without twist a cable that is bent without stress stays in its plane, whatever would grow out of it
    answer = predict(dataclasses.replace(scene, effects={**scene.effects, "twist": "off"}))
    assert answer.accuracy.dimensions == 2
    assert answer.status == "stalled"
    assert answer.accuracy.error_parts["start"] > UNDETERMINED * answer.scene.cable.length


def test_a_scene_that_does_not_determine_its_motion_is_no_success():
    scene = draw(90, 184).make()
    answer = predict(scene)
    length = scene.cable.length
    assert answer.status == "stalled"
    assert "does not determine its motion" in answer.message
    elsewhere = answer.accuracy.error_parts["start"]
    assert elsewhere > UNDETERMINED * length
    assert answer.accuracy.error_estimate is not None
    assert answer.accuracy.error_estimate >= elsewhere
    assert answer.level is not None
    # the start of another hand, which is bent another way by as much
    problem, motion = answer.level.problem, answer.level.motion
    start = motion.grid.start + bent(problem, motion.grid, seed=2)
    assert np.abs(start - motion.grid.start).max() < 4 * DISTURBED * length
    other = march(problem, motion.grid.changed(start=start), motion.asked, Monitor(None, None), rho=motion.rho)
    assert np.linalg.norm((other.states - motion.states)[..., :3], axis=-1).max() > UNDETERMINED * length


def test_what_falls_as_a_long_motion_begins_is_looked_at():
    """94:1642: a cable that stands on a point falls within 3 of 30 seconds, to where a micrometre sends it."""
    foot = Grasp(u=0.0, path=Move(displacement=(0.05, 0.0, 0.0), duration=30.0))
    cord = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2)
    shape = Straight(direction=(0.0, 0.0, 1.0))
    found = predict(Scene(cable=cord, shape=shape, grasps=(foot,), environment=Environment(drag=0.3)))
    assert found.status == "stalled"
    assert "does not determine its motion" in found.message


def test_what_is_unstable_for_seconds_of_a_minute_and_has_forgotten_its_start_is_found():
    found = predict(arch_with_feet_close_for(10.0))
    assert found.status == "stalled"
    assert "does not determine its motion" in found.message
    assert found.accuracy.error_parts["start"] > 0.3
    assert found.level is not None
    problem, motion = found.level.problem, found.level.motion
    # six looks would miss it, and so would a start that is bent
    (times, rates), *_ = determined._rates(problem, motion)
    assert rates.max() > 1.0
    assert not rates[np.searchsorted(times[1:], motion.times[-1] * np.arange(1, 6) / 6.0)].any()
    start = motion.grid.start + bent(problem, motion.grid, seed=1)
    other = march(problem, motion.grid.changed(start=start), motion.asked, Monitor(), rho=motion.rho)
    assert np.abs(other.states - motion.states).max() < 10 * DISTURBED
    brief = predict(arch_with_feet_close_for(0.5))  # too short to fall
    assert brief.status == "converged", brief.message


def test_scene_97_5133_counts_what_a_bend_moves_it_by():
    """It was `converged` at 0.3 % of the length, where a bend of a millionth of the length moves it by 0.7 to 1.1 %."""
    scene = draw(97, 5133).make()
    found = predict(scene)
    told = f"bending the start by a millionth of the length, {scene.cable.length:.2g} um, changes the motion"
    assert told in found.message
    assert found.accuracy.error_parts["start"] > 3 * DOUBTFUL * scene.cable.length


def test_scene_102_21_turns_over_sooner_or_later_as_its_sections_lie(monkeypatch: pytest.MonkeyPatch):
    """Its sections turn all together: whether half waves of a bend reach that hangs on which ones they are."""
    found = predict(draw(102, 21).make())
    assert found.status == "stalled"
    told = (
        "bending the start by a millionth of the length, 1 um, and turning its sections by 0.1 mrad changes the motion"
    )
    assert told in found.message
    assert found.level is not None
    problem, motion = found.level.problem, found.level.motion
    assert found.accuracy.error_parts["start"] > 5.0 * UNDETERMINED * problem.scene.cable.length
    monkeypatch.setattr(determined, "bent", lambda problem, grid, seed: bent(problem, grid, seed + 1))
    other = goes_astray(problem, motion, Monitor(), hard=False)  # by other waves
    assert other == pytest.approx(found.accuracy.error_parts["start"], rel=0.1)


def test_on_a_given_grid_a_note_tells_that_a_scene_does_not_determine_its_motion():
    scene = draw(90, 42943).make()
    found = predict(scene)
    grid = Quality(n_u=found.accuracy.n_u, n_t=found.accuracy.n_t, method="march", estimate=False)
    answer = predict(dataclasses.replace(scene, quality=grid))
    assert answer.status == "converged"
    assert (
        "Note: on this grid the scene does not determine its motion: bending the start by a millionth of the length"
        in answer.message
    )
    plain = predict(dataclasses.replace(drawn_over_a_table(0.0), quality=dataclasses.replace(grid, n_u=9, n_t=13)))
    assert "determine" not in plain.message


def test_where_a_start_was_bowed_twice_the_notes_tell(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(determined, "march", None)  # none is needed
    answer = predict(draw(90, 219).make())
    assert answer.status == "converged"
    assert "bow of 1 mm to its" in answer.message
    assert "out of it, and its mirror image is as likely" in answer.message


def test_two_grids_that_agree_on_what_is_not_determined_are_not_believed():
    """Grids of 13 and 19 points agreed to 5 mm on a wire twisted by 1.8 turns; finer ones are 50 mm from there."""
    scene = draw(90, 11778).make()
    answer = predict(scene)
    rows = [(i.n_u, i.update) for i in answer.iterations]
    assert rows[2][1] < 0.012 * scene.cable.length
    assert max(update for _, update in rows[3:]) > 0.05 * scene.cable.length
    assert answer.status == "stalled"
    assert answer.accuracy.error_parts["start"] > UNDETERMINED * scene.cable.length


def test_a_grid_that_is_finer_decides_whether_a_motion_is_determined(monkeypatch: pytest.MonkeyPatch):
    scene = dataclasses.replace(column(0.1, drag=1.0), quality=Quality(target_error=0.01))
    plain = predict(scene)
    assert plain.status == "converged"
    seen: list[tuple[int, int]] = []

    def on_the_first(problem: object, motion: determined.March, monitor: object, hard: bool) -> float:
        seen.append((motion.grid.n_u, motion.steps))
        return 0.5 * LENGTH if len(seen) == 1 else 0.0

    monkeypatch.setattr(doubts, "goes_astray", on_the_first)
    answer = predict(scene)
    assert answer.status == "converged"
    assert seen[0] == (plain.accuracy.n_u, plain.accuracy.steps)
    assert seen[1] == (answer.accuracy.n_u, answer.accuracy.steps)
    assert np.prod(seen[1]) > np.prod(seen[0])
    assert "start" not in answer.accuracy.error_parts


def test_what_a_bend_leaves_too_little_room_for_is_made_up_for_by_finer_grids():
    """Two grids agreed to 86 mm of 181, and a bend moves the motion by 121 mm: it was `stalled`."""
    scene = draw(165, 2942).make()
    found = predict(scene)
    target = scene.quality.target_error
    assert target is not None
    assert found.status == "converged", found.message
    assert found.accuracy.error_parts["start"] > 0.5 * target
    assert found.accuracy.error_estimate <= target
    assert "does not determine" not in found.message


@pytest.mark.parametrize(
    ("start", "contact", "estimate", "status"),
    [
        (0.006, 0.0, 0.003, "converged"),
        (0.006, 0.0, 0.005, "max_iterations"),  # a finer grid would do
        (0.012, 0.0, 0.001, "stalled"),
        (0.006, 0.005, 0.001, "stalled"),  # together they leave no room for any grid
        (0.003, 0.005, 0.003, "max_iterations"),
    ],
)
def test_only_what_no_grid_can_make_up_for_is_stalled(start: float, contact: float, estimate: float, status: Status):
    unsure = doubts.Doubts(start=start, contact=contact)
    assert unsure.status("converged", "", estimate, enough=0.01)[0] == status
    assert unsure.hopeless(0.01) == (status == "stalled")


@pytest.mark.parametrize("marches", [False, True])
def test_what_a_grid_says_is_not_forgotten_as_the_time_ends(marches: bool, monkeypatch: pytest.MonkeyPatch):
    """The time ends as the next grid is marched, or as it has been."""
    found: list[float] = []

    def astray(*_: object) -> float:
        if found:
            raise TimeIsUp
        found.append(0.5 * LENGTH)
        return found[0]

    def marched(*arguments: Any, **options: Any) -> Any:
        if found and not marches:
            raise TimeIsUp
        return march_level(*arguments, **options)

    monkeypatch.setattr(doubts, "goes_astray", astray)
    monkeypatch.setattr(refinement, "march_level", marched)
    answer = predict(dataclasses.replace(column(0.1, drag=1.0), quality=Quality(target_error=0.01)))
    assert answer.status == "stalled"
    assert answer.accuracy.error_parts["start"] == found[0]


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> Scene:
    """A scene with a time budget that is used up once two grids agree to 1 %, however fast the machine is."""

    class Hurried(refinement._Climb):
        def __post_init__(self) -> None:
            self.means.__dict__["next_fits"] = lambda *_: self.estimate > self.enough

    monkeypatch.setattr(refinement, "_Climb", Hurried)
    return dataclasses.replace(column(0.1, drag=1.0), quality=Quality(time_budget=600.0))


def late(*_: object) -> float:
    raise TimeIsUp


def test_where_no_time_is_left_to_look_the_answer_says_so(monkeypatch: pytest.MonkeyPatch):
    scene = dataclasses.replace(column(0.1, drag=1.0), quality=Quality(target_error=0.01))
    assert UNSEEN not in predict(scene).message
    monkeypatch.setattr(doubts, "goes_astray", late)
    found = predict(scene)
    assert found.status == "converged"
    assert UNSEEN in found.message


def test_where_no_time_is_left_of_a_budget_the_answer_says_so(hurried: Scene, monkeypatch: pytest.MonkeyPatch):
    assert UNSEEN not in predict(hurried).message
    monkeypatch.setattr(doubts, "goes_astray", late)
    found = predict(hurried)
    assert found.status == "converged"
    assert UNSEEN in found.message


def test_a_finer_grid_may_still_look_where_a_coarse_one_had_no_time(monkeypatch: pytest.MonkeyPatch):
    said = iter([0.5 * LENGTH, TimeIsUp, 0.0])

    def astray(*_: object) -> float:
        moved = next(said)
        if isinstance(moved, float):
            return moved
        raise moved

    climb = refinement._Climb(
        problem=pose(column(0.1)), means=Means(Monitor(), None, 1.0), target=1.0, enough=1.0, number=0
    )
    level = march_level(climb.problem, refinement.stretched(climb.problem, 0), climb.monitor)
    monkeypatch.setattr(doubts, "goes_astray", astray)
    for unseen in (False, True, False):
        climb.doubts.look(dataclasses.replace(level), climb.monitor, False)
        assert climb.doubts.unseen is unseen


def test_within_a_time_budget_the_answer_tells_what_is_not_determined(hurried: Scene, monkeypatch: pytest.MonkeyPatch):
    left: list[float] = []

    def astray(problem: object, motion: object, monitor: Monitor, hard: bool) -> float:
        left.append(monitor.remaining())
        return 0.3 * LENGTH

    monkeypatch.setattr(doubts, "goes_astray", astray)
    found = predict(hurried)
    assert "But the scene does not determine its motion" in found.message
    assert found.accuracy.error_parts["start"] == 0.3 * LENGTH
    assert found.accuracy.error_estimate == pytest.approx(sum(found.accuracy.error_parts.values()))
    assert len(left) == 1
    assert left[0] < 600.0


def test_a_part_of_a_solve_has_no_more_time_than_all_of_it():
    whole = Monitor(deadline=10.0, cancelled=lambda: True)
    assert whole.within(20.0).remaining() < 10.0
    assert 4.0 < whole.within(5.0).remaining() <= 5.0
    assert 4.0 < Monitor().within(5.0).remaining() <= 5.0
    with pytest.raises(Cancelled):
        whole.within(5.0).check()
    with pytest.raises(TimeIsUp):
        Monitor().within(-1.0).check()


def test_friction_resists_a_disturbance_as_that_of_what_slides() -> None:
    # as if at rest it would hold everything: a cable pushed straight over a rough table was not looked at again
    x = np.linspace(0.0, LENGTH, 41)
    scene = Scene(
        cable=Cable.preset("paper", bending_stiffness=2e-3, axial_stiffness=None),
        shape=Points(points=np.column_stack([x, 1e-5 * np.sin(np.pi * x)])),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.3, 0.0, 0.0), duration=3.0)),),
        environment=Environment(drag=0.05, table=Table(friction=1.0)),
        quality=Quality(n_u=13, n_t=25, method="march", estimate=False),
    )
    answer = predict(scene)
    assert answer.level is not None
    problem, motion = answer.level.problem, answer.level.motion
    assert may_grow(problem, motion)
    (window,) = motion.forces
    at, still = [len(window.times) // 2], np.zeros((1, *window.states.shape[1:]))
    speeds = (window.states[at] - window.states[[at[0] - 1]]) / (window.times[1] - window.times[0])

    def fastest(velocities: np.ndarray) -> float:
        laws = (problem.mass_density(), problem.drag_coefficient(), window.held.elimination, 1.0)
        behind = motion.behind(window.times[at])
        tables = motion.grid.tables
        return float(
            fastest_growth(problem.axes, window.states[at], velocities, behind, tables, *problem.laws, *laws)[0]
        )

    assert fastest(speeds) > 4.0 * max(fastest(still), 1.0)

"""Identification: simulated recordings give back what they were made with, and what they do not tell is said."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from benchmarks.simulated_recordings import CABLE, DRAG, Tracking, simulated, true_cable
from dlocore import (
    Cable,
    Cancelled,
    Environment,
    Grasp,
    Points,
    Quality,
    Scene,
    SceneError,
    Waypoints,
    equilibrium,
    predict,
)
from dlocore.identify import Candidate, Replay, Resolution, identify
from dlocore.identify.datasets import load_datasets
from dlocore.identify.estimate import _held_told
from dlocore.identify.parameters import parameters, prepared
from dlocore.identify.rest import Rest
from dlocore.identify.search import Search
from dlocore.recordings import Recording
from dlocore.spline import design_matrix

FINE = Resolution(n_u=17)
NAMES = ("bending_stiffness", "drag", "bending_damping")


def test_a_clean_recording_is_replayed_as_it_was() -> None:
    clean = Tracking(noise=0.0, held=0.0, outliers=0.0, lost=0.0)
    replay = Replay(simulated(3, 2.0, cable=CABLE, environment=DRAG, tracking=clean), Resolution(n_u=17, step=0.0025))
    predicted = replay.play(Candidate(cable=CABLE, environment=DRAG)).predicted
    away = np.linalg.norm((predicted - replay.markers)[:, replay.recording.free], axis=2)
    # net and steps are those of the truth, begun between two of them: what is left is the second order of steps of
    # 2.5 ms in a motion of up to half a metre within half a second
    assert away.max() < 4e-4


def test_a_badly_tracked_recording_gives_back_its_cable() -> None:
    cable, environment = true_cable(np.random.default_rng([5, 1]))
    found = identify([simulated(5, 4.0)], names=NAMES, resolution=FINE)
    truth = (cable.bending_stiffness, environment.drag, cable.bending_damping)
    assert found.status == "converged"
    for p, true in zip(found.parameters, truth, strict=True):
        assert true is not None
        # 5 %, the accuracy that benchmarks/identification.py measures over 50 trials
        assert p.value == pytest.approx(true, rel=0.05), p.name
        assert p.low < p.value < p.high
        assert p.identifiable


def test_twist_can_not_be_seen_in_a_planar_motion() -> None:
    still = Environment(gravity=(0.0, 0.0, -9.81), drag=0.06)
    flat = simulated(2, 2.0, cable=CABLE, environment=still, planar=True)
    known = Candidate(cable=replace(CABLE, torsional_stiffness=2e-3), environment=DRAG)
    found = identify([flat], names=("bending_stiffness", "torsional_stiffness"), start=known, iterations=4)
    stiffness, torsion = found.parameters
    assert stiffness.identifiable
    assert not torsion.identifiable
    assert "torsional_stiffness" in found.message


def test_a_hanging_shape_tells_the_bending_stiffness() -> None:
    x = simulated(4, 1.0, cable=CABLE, environment=DRAG, tracking=Tracking(noise=0.0, held=0.0, outliers=0.0, lost=0.0))
    rest = Recording(
        times=[0.0], markers=np.asarray(x.markers)[:1], u=x.u, held=x.held, length=1.0, linear_density=0.05, static=True
    )
    found = identify([rest], names=("bending_stiffness",), resolution=FINE)
    # no noise: what is left is the difference of the start's relaxation, far below a per cent
    assert found.parameters[0].value == pytest.approx(3e-3, rel=0.01)


def hanging() -> Recording:
    """Return the shape at rest of a cable of 8e-3 N m^2 that hangs from two points."""
    cable = Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=8e-3, axial_stiffness=600.0)
    x = np.linspace(0.0, 1.0, 41)
    sag = np.column_stack([0.54 * x, 0.0 * x, -1.2 * x * (1.0 - x)])
    sag /= np.linalg.norm(np.diff(sag, axis=0), axis=1).sum()
    shape = equilibrium(Scene(cable=cable, shape=Points(points=sag), grasps=[Grasp(u=0.0), Grasp(u=1.0)], horizon=1.0))
    u = np.linspace(0.0, 1.0, 11)
    markers = design_matrix(shape.knots_u, u) @ np.asarray(shape.control_points)[:, :3]
    return Recording(times=[0.0], markers=markers[None], u=u, held=(0, -1), linear_density=0.05, static=True)


@pytest.mark.parametrize("seed", [14, 21, 30])
def test_one_noisy_shape_tells_no_stiffness_for_sure(seed: int) -> None:
    shape = hanging()
    # with 2 mm of noise, on the held ends too, these are met best by cables of 0.5 to 0.7 N m^2
    noise = 2e-3 * np.random.default_rng(seed).standard_normal((1, 11, 3))
    noisy = replace(shape, markers=np.asarray(shape.markers) + noise)
    (stiffness,) = identify([noisy], names=("bending_stiffness",)).parameters
    assert stiffness.value > 0.1
    assert not stiffness.identifiable


def test_shapes_that_are_hardly_noisy_tell_the_stiffness() -> None:
    shape = hanging()
    noise = 2e-4 * np.random.default_rng(1).standard_normal((4, 11, 3))
    seen = replace(shape, times=np.arange(4.0), markers=np.asarray(shape.markers) + noise)
    (stiffness,) = identify([seen], names=("bending_stiffness",)).parameters
    assert stiffness.identifiable
    assert stiffness.low < 8e-3 < stiffness.high


def test_what_can_not_be_replayed_is_named() -> None:
    markers = np.zeros((12, 4, 3))
    markers[:, :, 0] = 0.1 * np.arange(4)
    free = Recording(times=np.arange(12) * 0.01, markers=markers)
    with pytest.raises(SceneError, match="held"):
        identify([free])
    with pytest.raises(SceneError, match="parameters"):
        identify([free], names=("colour",))
    for iterations in (0, 2.5, "25"):
        with pytest.raises(SceneError, match=r"^iterations: got .* an integer, at least 1"):
            identify([free], iterations=cast(Any, iterations))
    with pytest.raises(SceneError, match="recordings"):
        identify([])


def test_an_identification_is_cancelled() -> None:
    recording = simulated(3, 1.0, cable=CABLE, environment=DRAG)
    with pytest.raises(Cancelled):
        identify([recording], cancelled=lambda: True)


def test_a_data_set_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="dataset"):
        load_datasets([tmp_path / "nothing"])
    with pytest.raises(SceneError, match="dataset"):
        load_datasets([tmp_path])


def test_markers_beside_the_cable_are_found_beside_it() -> None:
    clean = Tracking(noise=0.0, held=0.0, outliers=0.0, lost=0.0)
    recording = simulated(3, 1.2, cable=CABLE, environment=DRAG, tracking=clean)
    offsets = np.zeros((13, 2))
    offsets[2:-2] = np.random.default_rng(7).normal(0.0, 0.006, (9, 2))
    truth = Candidate(cable=CABLE, environment=DRAG, marker_offsets=offsets)
    replay = Replay(recording, FINE)
    centred = replay.play(replace(truth, marker_offsets=None))
    shift = replay.positions(truth, centred.problem, centred.grid, centred.motion.times, centred.motion.states)
    shift = shift - centred.predicted
    # across the cable by as much as was asked for, also where the frame is carried over a bend
    size = np.linalg.norm(shift[:, 2:-2], axis=2)
    np.testing.assert_allclose(size, np.tile(np.linalg.norm(offsets[2:-2], axis=1), (len(size), 1)), rtol=2e-3)
    markers = np.asarray(recording.markers).copy()
    markers[replay.compared] += shift
    markers[: replay.compared[0]] += shift[0]
    found = identify(
        [replace(recording, markers=markers)],
        names=("bending_stiffness", "marker_offsets"),
        start=Candidate(cable=replace(CABLE, bending_stiffness=4e-3), environment=DRAG),
        resolution=FINE,
        iterations=8,
    )
    # the start is where a spring holds it to its markers, which leaves a tenth of their offsets to it
    np.testing.assert_allclose(found.candidate.marker_offsets[2:-2], offsets[2:-2], atol=1e-3)
    assert found.parameters[0].value == pytest.approx(3e-3, rel=0.05)


def test_the_outer_marker_of_a_clamp_stays_on_its_gripper() -> None:
    recording = simulated(
        3, 1.0, cable=CABLE, environment=DRAG, tracking=Tracking(noise=0.0, held=0.0, outliers=0.0, lost=0.0)
    )
    angles = np.full((2, 2), 0.3)
    predicted = Replay(recording, FINE).play(Candidate(cable=CABLE, environment=DRAG, clamp_angles=angles)).predicted
    away = predicted - np.asarray(recording.markers)[FINE.start_frames :]
    # however the cable leaves the clamp; a path of 100 Hz is smoothed by far less
    assert np.abs(away[:, [0, 1, -2, -1]]).max() < 2e-4


def swung(
    length: float, density: float, relative: float, *, noise: float, begin: float = 0.0, far: float = 0.12
) -> Recording:
    """Return a recording of a cable that hangs from a gripper which swings, from a time on, in units of its own.

    `relative` is EI / (density g L^3), the drag a quarter of the density a period; it swings `far` lengths.
    """
    period = np.sqrt(length)
    cable = Cable(
        length=length,
        diameter=0.005 * length,
        linear_density=density,
        bending_stiffness=relative * density * 9.81 * length**3,
        axial_stiffness=500.0 * density * 9.81 * length,
    )
    t = np.linspace(0.0, 4.0 * period, 161)
    ramp = 1.0 - np.exp(-((t / (0.4 * period)) ** 3))
    way = far * length * ramp[:, None] * np.sin(t[:, None] / period * [2.6, 3.3, 1.7])
    u = np.linspace(0.0, 1.0, 41)
    shape = length * np.column_stack([0.15 * np.sin(2.0 * u), 0.0 * u, -u])
    shape *= length / np.linalg.norm(np.diff(shape, axis=0), axis=1).sum()
    scene = Scene(
        cable=cable,
        shape=Points(points=shape, settle=True),
        grasps=[Grasp(u=0.0, path=Waypoints(times=t, positions=shape[0] + way))],
        environment=Environment(drag=0.25 * density / period),
        horizon=4.0 * period,
        quality=Quality(target_error=1e-3 * length),
        effects={"twist": "off", "inertia": "on"},
    )
    times = np.arange(begin, 4.0, 1.0 / 60.0) * period
    x = predict(scene).surface.positions(np.linspace(0.0, length, 9), times)
    x = x + noise * length * np.random.default_rng(1).standard_normal(x.shape)
    return Recording(times=times, markers=x, held=(0,), u=np.linspace(0.0, length, 9), length=length,
                     diameter=cable.diameter, linear_density=density)  # fmt: skip


@pytest.mark.parametrize(
    ("length", "density", "relative"), [(0.25, 0.01, 0.1), (1.0, 0.05, 1e-2), (2.2, 0.3, 0.14), (4.0, 0.3, 0.1)]
)
def test_a_cable_of_any_size_and_density_is_found_alike(length: float, density: float, relative: float) -> None:
    true = relative * density * 9.81 * length**3
    guess = Cable(
        length=length, diameter=0.005 * length, linear_density=density, bending_stiffness=5.0 * true,
        axial_stiffness=500.0 * density * 9.81 * length, bending_damping=1e-3 * true,
    )  # fmt: skip
    drag = 0.25 * density / np.sqrt(length)
    # it begins amid the motion, so that its start has to be found from the markers
    recording = swung(length, density, relative, noise=5e-4, begin=1.0)
    found = identify([recording], guess, Environment(drag=0.3 * drag), names=("bending_stiffness", "drag"))
    assert found.status == "converged"
    stiffness, air = found.parameters
    assert stiffness.value == pytest.approx(true, rel=0.05)
    assert air.value == pytest.approx(drag, rel=0.05)
    assert "missed" not in found.message


def test_a_model_that_misses_the_markers_says_so() -> None:
    recording = swung(1.0, 0.05, 1e-2, noise=5e-4)
    wrong = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=5e-2, axial_stiffness=250.0)
    found = identify([recording], wrong, Environment(drag=0.0125), names=("drag",))  # EI, which is wrong, is not sought
    assert "The free markers are missed by" in found.message
    assert "times what noise explains" in found.message


def test_a_start_that_no_cable_has_is_told_of_the_recording() -> None:
    recording = swung(1.0, 0.05, 1e-2, noise=5e-4)
    markers = np.array(recording.markers)
    markers[:, 1:] = markers[:, :1] + 3.0 * (markers[:, 1:] - markers[:, :1])  # in feet, say
    guess = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=5e-3)
    with pytest.raises(SceneError, match=r"^markers: got the first frames of 'recording', 0 to 0\.18") as error:
        Replay(replace(recording, markers=markers), Resolution()).play(
            Candidate(cable=guess, environment=Environment())
        )
    assert "control_points" not in str(error.value)  # which nobody gave


def test_a_motion_that_noise_alone_leads_astray_is_told_of() -> None:
    recording = swung(1.0, 0.05, 1e-4, noise=4e-3, far=0.6)  # a limp cable that whips
    guess = Cable(
        length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=5e-5, axial_stiffness=250.0
    )  # fmt: skip
    found = identify([recording], guess, Environment(drag=0.0125), names=("drag",))
    assert "Noise of the held markers and the start alone moves the prediction by" in found.message
    assert "times what noise explains" not in found.message


def still(frames: int = 40, step: float = 0.02, **facts: Any) -> Recording:
    """Return a recording of a cable that hangs still from its first marker."""
    markers = np.zeros((frames, 6, 3))
    markers[:, :, 2] = -0.1 * np.arange(6)
    given: dict[str, Any] = {"held": (0,), "linear_density": 0.05, "name": "still"} | facts
    return Recording(times=np.arange(frames) * step, markers=markers, **given)


def test_of_a_cable_that_hangs_still_nothing_is_told() -> None:
    found = identify([still()])
    assert found.status == "converged"
    assert not any(p.identifiable for p in found.parameters)
    for p in found.parameters:
        assert f"{p.name} can't be seen in these recordings" in found.message


@pytest.mark.parametrize("density", [None, 0.05])
def test_a_density_that_was_assumed_is_told_of(density: float | None) -> None:
    known, unknown = still(name="known", linear_density=density), still(41, name="unknown", linear_density=None)
    found = identify([unknown, known], names=("drag",))
    assert found.cable.linear_density == (density or 0.04)
    told = "0.04 kg/m is assumed. Stiffnesses, damping and drag are in proportion to it." in found.message
    assert told is (density is None)


@pytest.mark.parametrize(
    ("field", "asked"),
    [
        ("recordings", {"recordings": still()}),
        ("recordings[0]", {"recordings": [None]}),
        ("window", {"window": 0}),
        ("window", {"window": np.nan}),
        ("window", {"window": "5"}),
        ("step", {"resolution": Resolution(step=6e-6)}),
        ("parameters", {"names": "drag"}),
        ("cable", {"cable": CABLE, "start": Candidate(cable=CABLE, environment=DRAG)}),
        ("environment", {"environment": DRAG, "start": Candidate(cable=CABLE, environment=DRAG)}),
    ],
)
def test_what_can_not_be_used_is_refused(field: str, asked: dict[str, Any]) -> None:
    with pytest.raises(SceneError) as error:
        identify(**({"recordings": [still()]} | asked))
    assert error.value.field == field


@pytest.mark.parametrize("given", [None, 50.0])
def test_a_memory_rate_that_was_assumed_is_told_of(given: float | None) -> None:
    yields: dict[str, Any] = {} if given is None else {"yield_strain": 0.01, "memory_rate": given}
    recording = simulated(3, 0.5, cable=CABLE, environment=DRAG)
    asked = ("yield_strain",)
    found = identify(
        [recording], replace(CABLE, **yields), DRAG, names=asked, iterations=1, resolution=Resolution(n_u=9)
    )
    assert found.cable.memory_rate == (given or 100.0)
    told = "Neither given nor identified, so kept at an assumed value: memory_rate 100 1/s." in found.message
    assert told is (given is None)


@pytest.mark.parametrize("n_u", [100_000, 4, 0, -5, 13.0, True])
def test_a_number_of_control_points_out_of_range_is_refused(n_u: Any) -> None:
    with pytest.raises(SceneError) as error:
        identify([still()], resolution=Resolution(n_u=n_u))
    assert error.value.field == "n_u"


@pytest.mark.parametrize(
    ("other", "field", "said"),
    [
        (still(41, held=(), name="other"), "recordings['other'].held", "()"),
        (still(41, held=(), static=True, name="other"), "recordings['other'].held", "()"),
        (still(step=1e3, name="other"), "recordings['other'].times", "1 frame between 0 and 5 s"),
    ],
)
def test_the_recording_that_can_not_be_replayed_is_named(other: Recording, field: str, said: str) -> None:
    with pytest.raises(SceneError) as error:
        identify([still(), other])
    assert error.value.field == field
    assert said in error.value.given


def test_frames_too_far_apart_are_named_as_such() -> None:
    times = np.arange(40) * 0.02
    times[20:] += 1e6
    with pytest.raises(SceneError, match=r"Frames are up to 1e\+06 s apart"):
        identify([replace(still(), times=times)])


def test_a_part_of_the_cable_may_be_tracked() -> None:
    whole = swung(1.0, 0.05, 1e-2, noise=5e-4)
    part = replace(whole, markers=np.asarray(whole.markers)[:, :7], u=np.asarray(whole.u)[:7])
    guess = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=0.0147, axial_stiffness=250.0)
    found = identify([part], guess, Environment(drag=0.01), names=("bending_stiffness", "drag"))
    assert found.status == "converged"
    assert found.parameters[0].value == pytest.approx(4.905e-3, rel=0.02)
    assert found.parameters[1].value == pytest.approx(0.0125, rel=0.02)


def test_a_search_that_no_step_betters_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    costs = iter(range(1, 1000))
    monkeypatch.setattr(Search, "cost", lambda *_: float(next(costs)))
    start = Candidate(cable=replace(CABLE, bending_stiffness=1e-2), environment=DRAG)
    found = identify([simulated(3, 1.0, cable=CABLE, environment=DRAG)], names=("drag",), start=start)
    assert found.status == "max_iterations"
    assert found.message.startswith("Stopped without converging in 1 iteration, as no step improves the fit")


def test_offsets_of_markers_need_the_same_markers_in_every_recording() -> None:
    seen = still(name="known")
    fewer = replace(seen, markers=np.asarray(seen.markers)[:, :5], u=np.asarray(seen.u)[:5], name="fewer")
    with pytest.raises(SceneError, match=r"^recordings: got \[5, 6\] markers\."):
        identify([seen, fewer], names=("marker_offsets",))


@pytest.mark.parametrize(("names", "told"), [(("bending_damping",), True), (("bending_damping", "turn"), False)])
def test_damping_between_two_clamps_that_is_sought_without_twist_is_told_of(names: tuple[str, ...], told: bool) -> None:
    recording = simulated(3, 1.0, cable=CABLE, environment=DRAG)
    assert sum(h.towards is not None for h in recording.holds) == 2
    found = identify([recording], CABLE, DRAG, names=names, iterations=1)
    assert ("Replayed without twist" in found.message) is told


@pytest.mark.parametrize(
    "name", ["torsional_stiffness", "turn", "yield_strain", "rest_curvature", "marker_offsets", "a cable that yields"]
)
def test_what_needs_to_know_how_the_sections_lie_needs_a_clamp(name: str) -> None:
    names = ("drag",) if name.startswith("a cable") else ("drag", name)
    yields: Any = {"yield_strain": 0.02, "memory_rate": 100.0}
    guess = Cable(length=0.5, diameter=5e-3, linear_density=0.05, bending_stiffness=1e-3, **yields)
    with pytest.raises(SceneError, match=f"^recordings: got 'still' without a clamp.*which {name} needs") as told:
        identify([still()], guess if len(names) == 1 else None, names=names)
    assert "two neighbouring markers" in str(told.value)


def test_a_cable_that_yields_gives_back_its_yield_strain() -> None:
    recording = simulated(21, 1.5, cable=CABLE, environment=DRAG)
    replay = Replay(recording, Resolution(n_u=9))
    yielding = Candidate(cable=replace(CABLE, yield_strain=0.006, memory_rate=100.0), environment=DRAG, twist=True)
    bent = replay.play(yielding).predicted
    elastic = replay.play(replace(yielding, cable=CABLE)).predicted
    markers = np.array(recording.markers)
    free = recording.free
    seen = bent[:, free] + 1e-3 * np.random.default_rng(1).standard_normal(bent[:, free].shape)
    markers[replay.compared[:, None], free] = seen
    assert np.abs(bent - elastic).max() > 5e-3  # what yields is seen in the noise
    (strain,) = chosen = parameters(("yield_strain",), 2)
    start = prepared(Candidate(cable=CABLE, environment=DRAG), ("yield_strain",), 2)
    found = Search([replace(recording, markers=markers)], chosen, Resolution(n_u=9)).run(start, 15)
    assert found.status == "converged"
    assert strain.get(found.candidate) == pytest.approx(0.006, rel=0.02)  # of the same model; noise alone is left


def test_a_shape_that_no_cable_has_is_told_by_its_number() -> None:
    markers = np.array(still(static=True).markers)
    markers[3, 1:] *= 3.0
    guess = Cable(length=0.5, diameter=0.005, linear_density=0.05, bending_stiffness=5e-3)
    rest = Rest(replace(still(static=True), markers=markers), Resolution())
    with pytest.raises(SceneError, match=r"^markers\[3\]: got a shape at rest") as error:
        rest.play(Candidate(cable=guess, environment=Environment()))
    assert "control_points" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("shaken", "12 replays with other noise of the start can't begin"),
        ("finer", "1 replay on a finer net can't begin"),
    ],
)
def test_a_search_whose_errors_can_not_all_be_assessed_is_kept_with_a_doubt(
    name: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = Replay.__init__

    def refuse(self: Replay, recording: Recording, resolution: Resolution, *others: Any) -> None:
        if {"shaken": others[-1] is not None and len(others) > 1, "finer": resolution.n_u > 13}[name]:
            raise SceneError("markers", "the first frames", "others")
        made(self, recording, resolution, *others)

    monkeypatch.setattr(Replay, "__init__", refuse)
    found = identify([still()], names=("drag",), start=Candidate(cable=CABLE, environment=DRAG))
    assert found.status == "converged"
    assert f"{said}: the intervals do not include what they would add." in found.message


def test_a_derivative_is_taken_to_the_side_on_which_the_cable_can_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    search = Search([still()], parameters(("bending_stiffness",), 2), Resolution(n_u=9))
    state = search.play(Candidate(cable=CABLE, environment=DRAG))
    given = CABLE.bending_stiffness
    predicted = state.played[0].predicted

    def play(self: Replay, candidate: Candidate, like: Any = None) -> Any:
        stiffness = candidate.cable.bending_stiffness
        assert stiffness is not None
        assert given is not None
        if stiffness > given:
            raise SceneError("markers", "the first frames", "others")
        return replace(state.played[0], predicted=predicted + np.log(stiffness / given))

    monkeypatch.setattr(Replay, "differentiable", lambda *_: False)
    monkeypatch.setattr(Replay, "play", play)
    np.testing.assert_allclose(search.derivatives(state)[0], 1.0, rtol=1e-9)


def test_what_is_kept_at_an_assumed_value_is_told_of() -> None:
    assert (
        "Neither given nor identified, so kept at an assumed value: bending_stiffness 0.00125 N m^2, "
        "torsional_stiffness 0.00125 N m^2, bending_damping 0.0002 N m^2 s, drag_quadratic 0 N s^2/m^3, "
        "axial_stiffness 625 N, diameter 0.005 m." in identify([still()], names=("drag",)).message
    )


def test_what_is_sought_or_told_by_a_recording_is_not_told_of_as_assumed() -> None:
    message = identify([still(diameter=0.004)], names=("bending_stiffness", "bending_damping", "drag")).message
    assert message.endswith(
        "assumed value: torsional_stiffness 0.00125 N m^2, drag_quadratic 0 N s^2/m^3, axial_stiffness 625 N."
    )


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ({"cable": CABLE}, ": drag_quadratic 0 N s^2/m^3."),
        (
            {"environment": DRAG},
            ": bending_stiffness 0.00125 N m^2, torsional_stiffness 0.00125 N m^2, "
            "bending_damping 0.0002 N m^2 s, axial_stiffness 625 N, diameter 0.005 m.",
        ),
        ({"cable": CABLE, "environment": DRAG}, ""),
        ({"start": Candidate(cable=CABLE, environment=DRAG)}, ""),
    ],
)
def test_what_is_given_is_not_told_of_as_assumed(given: dict[str, Any], kept: str) -> None:
    message = identify([still()], names=("drag",), **given).message
    assert message.endswith(kept)
    assert ("Neither given nor identified" in message) is bool(kept)


@pytest.mark.parametrize(("damping", "told"), [(3e-4, False), (1e-3, True)])
def test_strong_damping_of_a_cable_that_may_turn_at_its_ends_is_told_of(damping: float, told: bool) -> None:
    """It twists as it swings in space, which the replays leave out."""
    recording = swung(1.0, 0.05, 1e-2, noise=5e-4)
    assert not any(h.towards is not None for h in recording.holds)
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=4.905e-3, bending_damping=damping)
    found = identify([recording], cable, Environment(drag=0.0125), names=("drag",), iterations=1)
    assert ("EI may come out far too large" in found.message) is told


def hung(*u: float, held: tuple[int, ...]) -> Recording:
    """Return a recording of a cable of 0.5 m that hangs still, with markers at u."""
    markers = np.zeros((40, len(u), 3))
    markers[:, :, 2] = -np.array(u)
    return Recording(times=np.arange(40) * 0.02, markers=markers, u=u, held=held, linear_density=0.05)


def test_how_held_neighbours_were_read_is_told() -> None:
    clamped, pointed = hung(0.0, 0.02, 0.3, 0.5, held=(0, 1)), hung(0.0, 0.0315, 0.3, 0.5, held=(0, 1, -1))
    clamp = "Held markers within 6 % of the length are a clamp: 0 and 1 (4 %)."
    points = (
        "Held neighbours farther apart than 6 % of the length are two point grasps, which leave the direction free: "
        "0 and 1 (6.3 %)."
    )
    assert _held_told([clamped, clamped]) == [clamp]
    assert _held_told([clamped, pointed]) == [clamp, points]
    assert not _held_told([hung(0.0, 0.1, 0.3, 0.5, held=(0, -1))])
    assert clamp in identify([clamped], names=("drag",), iterations=1, resolution=Resolution(n_u=9)).message

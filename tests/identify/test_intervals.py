"""How well parameters are known, in words and numbers."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulated_recordings import CABLE, DRAG, Tracking, simulated
from dlocore.identify import Candidate
from dlocore.identify.intervals import _doubts, _estimated
from dlocore.identify.parameters import parameters
from dlocore.identify.replay import Resolution
from dlocore.identify.search import Search
from dlocore.recordings import Recording

TRUTH = Candidate(cable=CABLE, environment=DRAG)
CLEAN = Tracking(noise=0.0, held=0.0, outliers=0.0, lost=0.0)


def doubts(*recordings: Recording, by_noise: float = 1e-3) -> str:
    """Return what is doubted where the recordings are replayed with the truth."""
    search = Search(recordings, parameters(("drag",), 2), Resolution(n_u=9))
    moved = {r.name: np.full(3, by_noise) for r in recordings if not r.static}
    return " ".join(_doubts(search, search.play(TRUTH), moved))


def at_rest() -> Recording:
    """Return the first shape of a motion that begins at rest."""
    moving = simulated(4, 0.5, cable=CABLE, environment=DRAG, tracking=CLEAN)
    return replace(moving, times=[0.0], markers=np.asarray(moving.markers)[:1], static=True)


@pytest.mark.parametrize(
    ("name", "value", "deviation", "said"),
    [
        ("bending_stiffness", 4e-3, 0.004, "bending_stiffness = 0.004 N m^2, known to 0.8 %."),
        ("length_ratio", 1.02, 0.002, "length_ratio = 1.02, known to 0.4 %."),
        ("drag", 0.05, 0.1, "drag = 0.05 N s/m^2, known to 20 %."),
        ("drag", 0.002, 0.01, "drag = 0.002 N s/m^2, known to 50 %."),
        ("turn", 0.5, 0.02, "turn = 0.5 rad, known to 0.04 rad."),
        ("turn", -0.5, 0.02, "turn = -0.5 rad, known to 0.04 rad."),
    ],
)
def test_a_statement_tells_half_the_interval(name: str, value: float, deviation: float, said: str) -> None:
    (p,) = parameters((name,), 2)
    search = Search((), (p,), Resolution())
    # two deviations of a logarithm, or of a usual value (0.05 N s/m^2 of drag, 1 rad of turn)
    found = _estimated(p, p.coordinate(value), deviation, 2.0, 1.0, search, np.zeros(0))
    assert found.statement == said


def test_shapes_at_rest_that_the_model_misses_are_doubted() -> None:
    shape = at_rest()
    exchanged = replace(shape, markers=np.asarray(shape.markers)[..., [0, 2, 1]])  # y for z
    assert not doubts(shape)
    assert "The free markers at rest are missed by" in doubts(exchanged)
    assert " % of the length" in doubts(exchanged)


def test_shapes_at_rest_are_not_hidden_by_a_motion_that_is_met() -> None:
    shape, moving = at_rest(), simulated(4, 1.0, cable=CABLE, environment=DRAG)
    exchanged = replace(shape, markers=np.asarray(shape.markers)[..., [0, 2, 1]])
    assert not doubts(moving)
    assert doubts(moving, exchanged).count("are missed by") == 1


def test_outliers_so_many_that_they_pass_for_noise_are_doubted() -> None:
    wild = simulated(4, 1.0, cable=CABLE, environment=DRAG, tracking=Tracking(outliers=0.3, size=0.1))
    # 30 % of 10 cm: most of the third differences that tell the noise hold one
    assert " % of the length: the tracking is wild, the model lacks something," in doubts(wild)


def test_a_plane_in_which_the_model_errs_is_not_hidden_by_the_noise_across_it() -> None:
    moving = simulated(4, 1.0, cable=CABLE, environment=DRAG)
    astray = np.array(moving.markers)
    astray[:, moving.free, 0] += 0.01 * np.asarray(moving.times)[:, None]  # 1 cm/s, along x alone
    assert not doubts(moving)
    assert " times what noise explains: the model lacks something" in doubts(replace(moving, markers=astray))


def test_the_recording_that_is_missed_most_is_named_where_there_are_several() -> None:
    moving, other = (simulated(seed, 1.0, cable=CABLE, environment=DRAG) for seed in (4, 6))
    astray = np.array(other.markers)
    astray[:, other.free] += 0.01 * np.asarray(other.times)[:, None, None]
    assert "The free markers of 'simulated 6' are missed by" in doubts(moving, replace(other, markers=astray))


def test_markers_that_are_somewhere_else_are_told_of_as_another_motion() -> None:
    moving = simulated(4, 1.0, cable=CABLE, environment=DRAG)
    above = np.array(moving.markers)
    above[..., 2] *= -1.0  # as if gravity were upwards
    assert "180 times what noise explains" in doubts(replace(moving, markers=above))
    assert "are gravity, held and the order of the markers right?" in doubts(replace(moving, markers=above))
    assert "gravity" not in doubts(replace(moving, markers=np.asarray(moving.markers) * 1.05))


def test_coordinates_that_were_not_measured_are_no_residuals() -> None:
    tracking = Tracking(outliers=0.0, held=0.0)
    flat = simulated(4, 1.0, cable=CABLE, environment=DRAG, planar=True, tracking=tracking)
    search = Search((flat,), parameters(("drag",), 2), Resolution(n_u=17))
    # 1 mm of noise in the plane; 0.7 mm where the coordinate across it and lost markers count
    assert search.deviation(search.play(TRUTH)) == pytest.approx(1e-3, rel=0.05)

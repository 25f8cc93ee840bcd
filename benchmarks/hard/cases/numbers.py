"""Hard grids and thresholds: the paper's case on grids far from the usual, and collocation that is ill-placed."""

from dataclasses import replace
from typing import Any

from benchmarks.hard.cases.base import apart, case, cord, move
from dlocore import Environment, Grasp, Prediction, Quality, Scene, Straight, Table, predict


def _paper(release: float | None = None, **quality: Any) -> Scene:
    grasps: tuple[Grasp, ...] = (Grasp(u=0.25, path=move(0, 0.5, time=1.6), release_time=release),)
    return Scene(
        cable=cord(axial_stiffness=640.0),
        shape=Straight(),
        grasps=grasps,
        environment=Environment(drag=0.05, table=Table()),
        quality=Quality(**quality),
    )


def _left_its_grid(p: Prediction) -> bool:
    asked = p.scene.quality
    return (p.accuracy.n_u, p.accuracy.n_t) != (asked.n_u, asked.n_t)


@case("numbers", "all laws, on finer grids", premise=_left_its_grid)
def smallest_grid() -> Scene:
    """5 by 5 control points: their time spline misses the march by 2.6 % of the length."""
    return _paper(n_u=5, n_t=5, method="march")


@case("numbers", "all laws")
def longest_grid() -> Scene:
    """129 control points along the cable: spans of 8 mm, axial waves of 0.1 ms."""
    return _paper(n_u=129, n_t=33, method="march", estimate=False)


@case("numbers", "all laws")
def finest_time() -> Scene:
    """513 control points in time."""
    return _paper(n_u=13, n_t=513, method="march", estimate=False)


@case("numbers", "all laws, on finer grids", premise=_left_its_grid)
def few_along_and_many_in_time() -> Scene:
    """5 by 257: time resolves waves that space does not; the march errs by an estimated 10 % of the length."""
    return _paper(n_u=5, n_t=257, method="march")


@case("numbers", "all laws, on finer grids", premise=_left_its_grid)
def many_along_and_few_in_time() -> Scene:
    """97 by 7: each step of the time spline is 0.3 s; the march errs by an estimated 3 % of the length."""
    return _paper(n_u=97, n_t=7, method="march")


@case("numbers", "an update below delta, or a status that is no success", error=lambda p: _above(p), within=0.0)
def smallest_threshold() -> Scene:
    """delta = 1e-10 m is below what rounding leaves of an update of the least squares."""
    return _paper(n_u=13, n_t=25, delta=1e-10, method="spacetime", estimate=False)


def _above(p: Prediction) -> float:
    """Return what the last update has too much; a march has none that delta could limit."""
    if p.accuracy.method == "march":
        return 0.0
    return max(0.0, p.iterations[-1].update - p.scene.quality.threshold)


def _untold(p: Prediction) -> float:
    """Return how far the true error, to a tenth of a per cent of the length, is above the estimate."""
    true = apart(p, predict(replace(p.scene, quality=Quality(target_error=1e-3))))
    return max(0.0, true - float(p.accuracy.error_estimate or 0.0))


@case("numbers", "all laws; the error is told", error=_untold, within=1e-3)
def largest_threshold() -> Scene:
    """delta = 1e-2 m is met by the first iteration, whatever its error."""
    return _paper(n_u=9, n_t=13, delta=1e-2, method="spacetime")


@case("numbers", "a SceneError that names n_t and the least that will do", refused="quality.n_t")
def too_few_in_time_for_a_release() -> Scene:
    """A release needs two time knots of its own: collocation on either side of one smooth span would average the jump
    away, which the paper warns does not converge."""
    return _paper(release=0.8, n_u=9, n_t=5, method="march")


@case("numbers", "a SceneError: the printed scheme has one smooth motion", refused="quality.method")
def collocation_across_a_release() -> Scene:
    """The paper's evenly spaced collocation points, with a release between two of them."""
    return _paper(release=0.8, n_u=7, n_t=13, method="paper")


@case("numbers", "a SceneError that names n_u and the least that will do", refused="quality.n_u")
def too_few_along_for_the_grasps() -> Scene:
    """Seven grasps need a knot each, which five control points do not have."""
    grasps = tuple(Grasp(u=(i + 1) / 8, path=move(0, 0.2)) for i in range(7))
    quality = Quality(n_u=5, n_t=13, method="march")
    return Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=Environment(table=Table()), quality=quality)

"""The plots of a study: each says what it shows, in units, with a finding as its title."""

from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from matplotlib.axis import Axis
from matplotlib.figure import Figure

from dlocore.study import accuracy_plots, cost_plots, drawing
from dlocore.study.record import EffectCost, Run, Scaled, Step, Study
from dlocore.study.style import new_figure, write_decimals


def run(method: str, n_u: int, time: float, error: float, **changes: object) -> Run:
    values = {
        "scene": "a scene", "effects": "auto", "method": method, "n_u": n_u, "n_t": 2 * n_u, "delta": 1e-5,
        "dimensions": 2, "steps": 64, "status": "converged", "wall_time": time, "spread": 0.1 * time, "repeats": 5,
        "error": error, "rms": error / 3, "truth_error": 1e-6, "estimate": None,
        "iterations": tuple(Step(update=u, residual=1e-3, wall_time=time) for u in (None, 1e-6)),
        "phases": {"setup": 0.1 * time, "march": 0.9 * time}, "active": ("bend",),
    }  # fmt: skip
    return Run(**(values | changes))  # type: ignore[arg-type]


def study(**parts: object) -> Study:
    runs = [run(m, n, c * n**2, 0.1 / n**2) for m, c in (("march", 1e-5), ("spacetime", 1e-4)) for n in (9, 17, 33)]
    values = {
        "machine": {"processor": "a processor", "Python": "3.11"}, "source": "0" * 12,
        "measured_at": "2026-01-31T12:00:00Z", "duration": 1.0, "judge": "march", "runs": tuple(runs),
        "scaling": tuple(
            Scaled(variable=v, value=x, method="march", wall_time=1e-3 * x**1.5, spread=1e-5)
            for v in ("n_u", "n_u in space", "n_t", "horizon", "grasps") for x in (2.0, 4.0, 8.0, 16.0)
        ),
        "effects": (EffectCost(effect="drag", present=2e-3, absent=1e-3),),
    }  # fmt: skip
    return Study(**(values | parts))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "draw",
    [
        accuracy_plots.work_precision,
        accuracy_plots.convergence,
        cost_plots.phases,
        cost_plots.effect_costs,
        cost_plots.scaling,
    ],
)
def test_every_axis_has_a_quantity_with_its_unit_and_a_title(draw: object) -> None:
    figure: Figure = draw(study())  # type: ignore[operator]
    for axes in figure.axes:
        assert axes.get_title()
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert not label or "[" in label or label == "iteration"
        assert axes.get_xlabel()


def test_the_title_names_the_fastest_way_to_a_millimetre() -> None:
    (axes,) = accuracy_plots.work_precision(study()).axes
    # 0.1/n^2 m: 0.35 mm at n = 17 in 1e-5 17^2 s = 2.9 ms, which 9 (1.2 mm) does not reach
    assert "1 mm in 2.9 ms by march" in axes.get_title()


def test_the_title_counts_the_scene_that_errs_most() -> None:
    both = [
        run("march", n, 1e-5 * n**2, share * 0.1 / n**2, scene=f"scene {share}")
        for n in (9, 17, 33) for share in (0.25, 4.0)
    ]  # fmt: skip
    (axes,) = accuracy_plots.work_precision(study(runs=tuple(both))).axes
    # geometric means as before, but the worse scene errs by 1.4 mm at n = 17 and by 0.37 mm at n = 33, in 11 ms
    assert "1 mm in 11 ms by march" in axes.get_title()
    (axes,) = accuracy_plots.work_precision(study(runs=tuple(both[:4]))).axes
    assert "at best 1.4 mm, in 2.9 ms by march" in axes.get_title()


def test_sets_of_effects_are_told_apart() -> None:
    runs = [
        run(method, n, 1e-4 * n**2, share / n**2, effects=effects)
        for method in ("march", "spacetime")
        for n in (9, 17, 33)
        for effects, share in (("auto", 0.1), ("no drag", 0.2))
    ]
    both = study(runs=tuple(runs))
    (axes,) = accuracy_plots.work_precision(both).axes
    curves = {line.get_label(): line for line in axes.lines if "," in str(line.get_label())}
    assert {"march, effects auto", "march, effects no drag", "spacetime, effects no drag"} <= set(curves)
    one, other = curves["march, effects auto"], curves["march, effects no drag"]
    assert [len(line.get_xdata()) for line in (one, other)] == [3, 3]
    assert one.get_linestyle() != other.get_linestyle()
    assert one.get_marker() != other.get_marker()
    (axes,) = accuracy_plots.convergence(both).axes
    named = {line.get_label(): line.get_marker() for line in axes.lines}
    assert named["effects auto"] != named["effects no drag"]
    assert {line.get_marker() for line in axes.lines} >= {named["effects auto"], named["effects no drag"]}
    (axes,) = accuracy_plots.work_precision(study()).axes
    assert "march" in [line.get_label() for line in axes.lines], "the only set needs no name"


def several() -> Study:
    """Return a study of two thresholds, in the plane with one set of effects and in space with another."""
    return study(
        runs=tuple(
            run(method, n, time * n**2, 0.1 / n**2, effects=effects, dimensions=d, delta=delta)
            for effects, d in (("auto", 2), ("all", 3))
            for method, delta, time in (("march", 1e-5, 1e-5), ("spacetime", 1e-5, 2e-4), ("spacetime", 1e-3, 1e-4))
            for n in (9, 17)
        )
    )


def test_thresholds_are_told_apart() -> None:
    names = [f"spacetime, effects auto, δ = {delta} m" for delta in ("1e-05", "0.001")]
    flat, _ = accuracy_plots.work_precision(several()).axes
    curves = {line.get_label(): line for line in flat.lines}
    times = [list(curves[name].get_xdata()) for name in names]
    assert times == [pytest.approx([1e3 * c * n**2 for n in (9, 17)]) for c in (2e-4, 1e-4)]
    assert curves[names[0]].get_marker() != curves[names[1]].get_marker()
    assert "march, effects auto" in curves, "a march has one threshold only, which needs no name"
    (axes,) = cost_plots.phases(several()).axes
    rows = [label.get_text() for label in axes.get_yticklabels()]
    assert len(rows) == 12
    assert all(f"{name}  9 × 18" in rows for name in names)


def test_a_set_of_effects_has_one_marker_in_all_panels() -> None:
    flat, space = accuracy_plots.work_precision(several()).axes
    marker = {line.get_label(): line.get_marker() for axes in (flat, space) for line in axes.lines}
    assert marker["march, effects auto"] != marker["march, effects all"]


def test_a_long_legend_and_title_hide_nothing() -> None:
    figure = accuracy_plots.work_precision(several())
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert axes.get_legend().get_window_extent().y1 <= axes.xaxis.get_tightbbox().y0
        assert axes.title.get_window_extent().x0 >= 0
        assert axes.title.get_window_extent().x1 <= figure.bbox.x1


def written(axis: Axis) -> list[float]:
    """Return the numbers at an axis, within what is seen of it."""
    low, high = axis.get_view_interval()
    found = []
    for at, form in (
        (axis.get_majorticklocs(), axis.get_major_formatter()),
        (axis.get_minorticklocs(), axis.get_minor_formatter()),
    ):
        found += [float(form(x, k)) for k, x in enumerate(at) if low <= x <= high and form(x, k)]
    return sorted(found)


@pytest.mark.parametrize(
    ("low", "high"), [(0.6, 0.95), (0.82, 2.1), (1.1, 1.7), (3.0, 30.0), (8.0, 21.0), (3.0, 90.0), (0.5, 2000.0)]
)
def test_an_axis_has_three_numbers_at_least(low: float, high: float) -> None:
    _, (axes,) = new_figure(4.0, 3.0)
    axes.set(xscale="log", xlim=(low, high))
    write_decimals(axes.xaxis)
    assert len(written(axes.xaxis)) >= 3
    assert all(low <= x <= high for x in written(axes.xaxis))


def test_effects_that_make_it_faster_have_numbers_too() -> None:
    costs = (EffectCost(effect="bend", present=1e-3, absent=5e-3), EffectCost(effect="drag", present=2e-3, absent=1e-3))
    (axes,) = cost_plots.effect_costs(study(effects=costs)).axes
    assert written(axes.xaxis) == [0.2, 0.5, 1.0, 2.0]


def test_the_caption_stays_within_a_narrow_figure_and_below_its_axes() -> None:
    named = study(machine={"processor": "a processor with a long name at so many GHz " * 3, "Python": "3.11"})
    figure = accuracy_plots.work_precision(named)
    drawing._caption(figure, named)
    figure.draw_without_rendering()
    (caption,) = figure.texts
    box = caption.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.x1
    assert 0 <= box.y0 < box.y1 <= figure.axes[0].get_tightbbox().y0


def test_the_legend_of_the_convergence_hides_no_iterations() -> None:
    figure = accuracy_plots.convergence(study())
    figure.draw_without_rendering()
    (axes,) = figure.axes
    legend = axes.get_legend().get_window_extent()
    assert legend.x0 >= axes.bbox.x1
    assert legend.x1 <= figure.bbox.x1


def test_the_exponents_in_the_titles_are_those_of_the_data() -> None:
    assert all("1.50 (march)" in axes.get_title() for axes in cost_plots.scaling(study()).axes)


def test_only_what_was_measured_is_drawn(tmp_path: Path) -> None:
    files = drawing.draw_all(study(scaling=(), effects=()), tmp_path / "plots")
    assert [file.name for file in files] == ["work-precision.png", "convergence.png", "phases.png"]
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
    assert not drawing.draw_all(study(scaling=(), effects=(), runs=()), tmp_path)


def test_runs_that_did_not_converge_are_on_no_front() -> None:
    lost = study(runs=tuple(run("march", n, 1e-3, 1e-3, status="stalled") for n in (9, 17)))
    (axes,) = accuracy_plots.work_precision(lost).axes
    assert "nothing converged" in axes.get_title()
    assert "open: did not converge" in [line.get_label() for line in axes.lines]
    (axes,) = accuracy_plots.convergence(study(runs=(run("spacetime", 9, 1e-3, 1.0, status="max_iterations"),))).axes
    assert "0 of 1" in axes.get_title()

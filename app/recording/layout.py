"""How the viewer lays a recording out."""

import tempfile
from functools import cache
from pathlib import Path

from app.recording.style import APPLICATION


@cache
def layout() -> bytes:
    """Return the layout of the viewer for these recordings, as the bytes of an .rbl file."""
    import rerun.blueprint as rrb

    shapes = rrb.Vertical(
        rrb.Spatial3DView(origin="/iterate", name="Iterate (timeline: iteration)"),
        rrb.Spatial3DView(origin="/motion", name="Motion (timeline: motion)"),
    )
    plots = rrb.Vertical(
        rrb.TimeSeriesView(origin="/convergence", name="Update and residual, log10"),
        rrb.TimeSeriesView(origin="/forces", name="Forces by effect, log10"),
        rrb.Tabs(
            rrb.TimeSeriesView(origin="/energy", name="Energy at the end"),
            rrb.TimeSeriesView(origin="/step", name="Damping, step"),
            rrb.TextLogView(origin="/log", name="Log"),
        ),
    )
    words = rrb.Vertical(
        rrb.TextDocumentView(origin="/report", name="Report"),
        rrb.Tabs(
            rrb.TextDocumentView(origin="/effects", name="Effects"),
            rrb.TimeSeriesView(origin="/over_time/reaction", name="Reactions (motion)"),
            rrb.TimeSeriesView(origin="/over_time/energy", name="Energy (motion)"),
        ),
    )
    blueprint = rrb.Blueprint(
        rrb.Horizontal(shapes, plots, words, column_shares=[4, 3, 3]),
        rrb.TimePanel(timeline="iteration", state="collapsed", play_state="following"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "layout.rbl"
        blueprint.save(APPLICATION, path)
        return path.read_bytes()

"""The layout of a recording in the viewer."""

import tempfile
from functools import cache
from pathlib import Path

from app.recording.style import APPLICATION


@cache
def layout() -> bytes:
    """Return the layout of the viewer for these recordings, as the bytes of an .rbl file.

    The solve and the motion have a tab each, because they have different timelines. The viewer shows a single timeline
    at a time, so the other tab shows only what holds at every time.
    """
    import rerun.blueprint as rrb

    solve = rrb.Horizontal(
        rrb.Vertical(
            rrb.Spatial3DView(origin="/iterate", name="Iterate: shape over time, control net"),
            rrb.Tabs(
                rrb.TimeSeriesView(origin="/energy", name="Energy at the end"),
                rrb.TimeSeriesView(origin="/step", name="Damping and step length"),
                rrb.TextLogView(origin="/log", name="Log"),
            ),
            row_shares=[2, 1],
        ),
        rrb.Vertical(
            rrb.TimeSeriesView(origin="/convergence", name="Update and residual, log10"),
            rrb.TimeSeriesView(origin="/forces", name="Forces by effect, without contact, log10"),
        ),
        rrb.Vertical(
            rrb.TextDocumentView(origin="/report", name="Report"),
            rrb.TextDocumentView(origin="/effects", name="Effects"),
        ),
        column_shares=[4, 3, 3],
        name="Solve (timeline: iteration or solver_time)",
    )
    motion = rrb.Horizontal(
        rrb.Spatial3DView(origin="/motion", name="Motion: cable, grasps, reactions"),
        rrb.Vertical(
            rrb.TimeSeriesView(origin="/over_time/reaction", name="Reactions and contacts"),
            rrb.TimeSeriesView(origin="/over_time/energy", name="Energy"),
        ),
        column_shares=[5, 2],
        name="Motion (timeline: motion)",
    )
    blueprint = rrb.Blueprint(
        rrb.Tabs(solve, motion),
        rrb.TimePanel(timeline="iteration", state="collapsed", play_state="following"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "layout.rbl"
        blueprint.save(APPLICATION, path)
        return path.read_bytes()

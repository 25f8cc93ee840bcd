"""A run as a rerun recording: how the solve went by iteration, and the motion it found.

Timelines: `iteration` and `solver_time` for the solve, `motion` [s] for the predicted motion. Recordings are written
from chunks: a `RecordingStream` would keep two threads each for ever.
"""

from pathlib import Path

from app.archive import Run
from app.recording.layout import layout
from app.recording.motion import motion_chunks
from app.recording.page import page_chunks
from app.recording.solve import solve_chunks
from app.recording.style import APPLICATION, axes_chunk

__all__ = ["APPLICATION", "layout", "write_recording"]


def write_recording(run: Run, path: Path) -> None:
    """Write the recording of `run` to `path` (.rrd).

    Raises:
        OSError: it can't be written there.
    """
    import rerun as rr

    chunks = [axes_chunk(), *solve_chunks(run), *motion_chunks(run), *page_chunks(run)]
    stream = rr.chunk.LazyChunkStream.from_iter(chunks)
    try:
        stream.write_rrd(path, application_id=APPLICATION, recording_id=run.document["id"])
    except RuntimeError as error:  # as rerun tells of a file that can't be written
        raise OSError(str(error)) from error

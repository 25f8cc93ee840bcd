"""Write a run as a rerun recording: the solve by iteration, the predicted motion, and the layout of the viewer.

Timelines: `iteration` and `solver_time` for the solve, `motion` [s] for the predicted motion.
"""

import uuid
from datetime import datetime
from pathlib import Path

from app.archive import Run
from app.recording.layout import layout
from app.recording.motion import motion_chunks
from app.recording.page import page_chunks
from app.recording.solve import solve_chunks
from app.recording.style import APPLICATION, axes_chunk
from dlocore.words import counted

__all__ = ["APPLICATION", "layout", "write_recording"]


def write_recording(run: Run, path: Path, name: str = "") -> None:
    """Write the recording of `run` to `path` (.rrd).

    The recording has the name of the request, otherwise `name`, otherwise a description of the scene. A run that is not
    stored has no id and gets a new one, since the viewer merges recordings with the same id.

    Raises:
        OSError: the file can't be written.
    """
    import rerun as rr
    import rerun_bindings

    chunks = [axes_chunk(), *solve_chunks(run), *motion_chunks(run), *page_chunks(run)]
    id = run.document["id"] or uuid.uuid4().hex
    stream = rr.RecordingStream(APPLICATION, recording_id=id, send_properties=False)
    content = rr.binary_stream(stream)
    stream.send_recording_name(run.request.get("name") or name or _words(run))
    began = datetime.fromisoformat(run.document["created"])
    stream.send_recording_start_time_nanos(round(1e6 * began.timestamp()) * 1000)
    stream.log_file_from_contents("layout.rbl", layout())
    stream.send_chunks(chunks)
    written = content.read() or b""
    del content, stream
    rerun_bindings.flush_and_cleanup_orphaned_recordings()  # otherwise its two threads would never end
    path.write_bytes(written)


def _words(run: Run) -> str:
    scene = run.scene
    cable = f"{run.request['cable'].get('preset') or 'cable'} of {scene.cable.length:g} m"
    return f"{cable}, {counted(len(scene.grasps), 'grasp')}, {scene.horizon:g} s"

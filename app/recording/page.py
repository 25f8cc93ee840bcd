"""The text pages: one with status, settings, machine and scene, and one with the effects and their reasons."""

import json
from typing import TYPE_CHECKING, Any

from app.archive import Run
from app.recording.motion import arrow_scale
from app.recording.style import chunk
from dlocore.words import in_mm, in_ms

if TYPE_CHECKING:
    from rerun.chunk import Chunk

MAX_PART = 4_000  # most characters of one part of the scene


def page_chunks(run: Run) -> "list[Chunk]":
    """Return both pages, which show on every timeline."""
    return [_page("/report", report(run)), _page("/effects", effects(run))]


def _page(entity: str, text: str) -> "Chunk":
    import rerun as rr

    return chunk(entity, [], rr.TextDocument.columns(text=[text], media_type=["text/markdown"]))


def report(run: Run) -> str:
    """Return the status, the settings, the machine and the scene as Markdown."""
    document, accuracy = run.document, run.document["accuracy"]
    error = accuracy["error_estimate"]
    return "\n".join(
        [
            f"# {document['status']}",
            document["message"],
            "",
            "## Solve",
            f"- method: {accuracy['method']}, {len(run.iterations)} iterations or levels",
            f"- estimated error: {'unknown' if error is None else in_mm(error, 3)}",
            f"- solve time: {in_ms(accuracy['wall_time'])}",
            f"- start shape: {document['start']['elastic_energy']:.3g} J elastic energy, "
            f"{in_mm(document['start']['fit_error'], 3)} rms from the given points",
            f"- machine: {run.machine}",
            f"- run: {document['id'] or 'not stored'}, {document['created']}",
            "",
            "## Settings",
            f"- requested quality: `{json.dumps(run.request.get('quality', 'auto'))}`",
            f"- net: {accuracy['n_u']} x {accuracy['n_t']} control points (cable x time), {accuracy['dimensions']}D, "
            f"{accuracy['steps']} time steps of the march",
            f"- delta: {accuracy['delta']:g} m",
            f"- arrows: {arrow_scale(run):.3g} m for 1 N",
            "",
            "## Scene",
            "```json",
            *[f'"{name}": {_cut(json.dumps(part))}' for name, part in run.request.items()],
            "```",
        ]
    )


def effects(run: Run) -> str:
    """Return a table of the effects as Markdown; simulated effects come first."""
    ordered = sorted(run.document["effects"], key=lambda effect: not effect["active"])
    return "\n".join(["| effect | active | why | magnitude |", "|---|---|---|---|", *map(_row, ordered)])


def _cut(text: str) -> str:
    return text if len(text) <= MAX_PART else f"{text[:MAX_PART]} ... ({len(text)} characters)"


def _row(effect: dict[str, Any]) -> str:
    why = effect["reason"].replace("|", "/").replace("\n", " ")
    magnitude = "" if effect["magnitude"] is None else f"{effect['magnitude']:.3g} {effect['unit']}"
    return f"| {effect['name']} | {'yes' if effect['active'] else 'no'} | {why} | {magnitude} |"

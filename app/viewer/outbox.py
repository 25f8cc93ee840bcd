"""Send what leaves a tab: its scene, its playback and its picture as files, its run to the store."""

import asyncio
import json
import logging
import re
from typing import Any, Protocol

import numpy as np
from viser import ClientHandle

from app.schemas import Motion
from app.viewer.draft import Draft
from app.viewer.export import playback_page, png
from app.viewer.picture import Look
from dlocore import Prediction

PICTURE_SIZE = (1080, 1920)  # px, height and width of a saved picture
LONGEST_NAME = 60  # most characters of a scene's name in the name of a file
PICTURE_WAIT = 20.0  # s that the browser gets to draw the picture
_log = logging.getLogger(__name__)


def file_name(draft: Draft, ending: str) -> str:
    """Return the name for a file of a scene: `ending`, preceded by the scene's name if it has one."""
    name = re.sub(r"\W+", "-", draft.get(("name",), "")).strip("-_")[:LONGEST_NAME]
    return f"{name}-{ending}" if name else ending


class Runs(Protocol):
    """Where runs are stored."""

    def save(self, scene_json: dict[str, Any], prediction: Prediction, *, name: str = "") -> tuple[str, bytes]:
        """Store a run; return its id and its document."""

    def request(self, id: str) -> bytes | None:
        """Return the scene of a stored run."""

    def motion(self, id: str) -> Motion | None:
        """Return the motion of a stored run."""


class Outbox:
    """Sends files to the browser of a client, and stores its runs.

    Args:
        client: the client.
        runs: where runs are stored.
    """

    def __init__(self, client: ClientHandle, runs: Runs) -> None:
        self._client = client
        self._runs = runs

    def scene(self, draft: Draft) -> None:
        """Send the scene as the file that the API and the command line read."""
        self._send(file_name(draft, "scene.json"), json.dumps(draft.document, indent=2).encode())

    async def playback(self, draft: Draft, prediction: Prediction, look: Look, speed: float) -> None:
        """Send a playback as a page that opens offline, seen as the client sees it now."""
        camera = self._client.camera
        pose = (np.array(camera.position), np.array(camera.look_at))
        page = await asyncio.to_thread(playback_page, prediction, look, pose, fov=camera.fov, speed=speed)
        self._send(file_name(draft, "playback.html"), page)

    async def picture(self, draft: Draft) -> None:
        """Send a picture of the scene, which the browser draws larger than on the screen and without the panel."""
        height, width = PICTURE_SIZE
        try:
            picture = await asyncio.to_thread(
                self._client.get_render, height, width, transport_format="png", timeout=PICTURE_WAIT
            )
        except (TimeoutError, RuntimeError) as error:
            self._client.add_notification("No picture", str(error), color="red")
            return
        self._send(file_name(draft, "picture.png"), await asyncio.to_thread(png, picture))

    async def keep(self, draft: Draft, prediction: Prediction) -> str | None:
        """Store a run and return its id; if that fails, notify the client, log the reason, and return None."""
        name = draft.get(("name",), "")
        try:
            id, _ = await asyncio.to_thread(self._runs.save, draft.document, prediction, name=name)
        except Exception:
            _log.exception("the run could not be stored")
            self._client.add_notification("Not kept", "The run could not be stored; the log says why.", color="red")
            return None
        return id

    def _send(self, name: str, content: bytes) -> None:
        self._client.send_file_download(name, content, save_immediately=True)

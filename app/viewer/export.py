"""Export from the scene: a playback as one HTML page that opens offline, and a picture."""

import contextlib
from typing import Any

import imageio.v3 as iio
import numpy as np
import viser
from viser import _messages

from app.viewer.picture import Look, Picture
from app.viewer.playback import REST_AT_END
from app.viewer.quiet import quiet_console
from dlocore import Prediction

FRAMES = 30  # a second
MOST_FRAMES = 600
Pose = tuple[np.ndarray, np.ndarray]


def playback_page(prediction: Prediction, look: Look, camera: Pose, *, fov: float, speed: float) -> bytes:
    """Return a self-contained page that plays a prediction.

    A separate viser server records what the picture draws. It listens on the loopback address and is stopped at once.

    Args:
        prediction: what to play.
        look: how to draw it.
        camera: its position and the point it looks at [m].
        fov: field of view [rad].
        speed: predicted seconds per second.
    """
    with quiet_console():
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            server._websock_server.unregister_handler(message)
        server.scene.set_up_direction("+z")
        server.initial_camera.position, server.initial_camera.look_at = camera
        server.initial_camera.fov = fov
        picture = Picture(server.scene)
        picture.restyle(look)
        picture.show(prediction)
        serializer = server.get_scene_serializer()
        horizon = prediction.surface.horizon
        frames = int(np.clip(np.ceil(FRAMES * horizon / speed), 2, MOST_FRAMES))
        for time in np.linspace(0.0, horizon, frames):
            picture.pose(float(time))
            serializer.insert_sleep(horizon / speed / frames)
        serializer.insert_sleep(REST_AT_END)
        return serializer.as_html().encode()
    finally:
        with quiet_console(), contextlib.suppress(RuntimeError):
            server.stop()


def png(picture: np.ndarray[Any, np.dtype[np.uint8]]) -> bytes:
    """Return a picture (height, width, 3 or 4) as a PNG file."""
    return iio.imwrite("<bytes>", picture, extension=".png")

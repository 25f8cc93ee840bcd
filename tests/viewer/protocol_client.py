"""A viewer client without a browser, which speaks the protocol of the scene's websocket."""

import contextlib
import json
import time
from collections.abc import Callable
from typing import Any
from uuid import uuid4

import httpx
import msgspec.msgpack
import numpy as np
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect

IDENTITY = (1.0, 0.0, 0.0, 0.0)
SUBPROTOCOL = f"viser-v{viser.__version__}"


def decode(frame: bytes) -> list[dict[str, Any]]:
    """Return the messages of a frame; arrays in them as NumPy arrays."""
    packed = int.from_bytes(frame[8:16], "little")
    document = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed]))
    buffers, offset = [], 16 + packed
    for size in document["binaryBufferLengths"]:
        offset += -offset % 8
        buffers.append(frame[offset : offset + size])
        offset += size

    def filled(value: Any) -> Any:
        if isinstance(value, dict):
            if "__binary_index" in value:
                return np.frombuffer(buffers[value["__binary_index"]], dtype=value["dtype"])
            return {key: filled(part) for key, part in value.items()}
        return [filled(part) for part in value] if isinstance(value, list) else value

    return [filled(message) for message in document["messages"]]


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until `condition` holds, which needs no messages to be processed."""
    give_up = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < give_up, "it did not come to that in time"
        time.sleep(0.02)


class SceneClient:
    """Connects to the scene, and keeps the last state of its nodes and controls that the server sent."""

    def __init__(self, url: str, **options: Any) -> None:
        # unread frames delay the closing handshake: don't wait for it
        self.socket: ClientConnection = connect(
            url, subprotocols=[SUBPROTOCOL], max_size=None, proxy=None, close_timeout=0.3, **options
        )
        self.nodes: dict[str, dict[str, Any]] = {}
        self.positions: dict[str, list[float]] = {}
        self.visible: dict[str, bool] = {}
        self.owners: dict[str, str] = {}
        self.controls: dict[str, dict[str, Any]] = {}
        self.notifications: list[str] = []
        self.notices: list[str] = []  # their texts
        self.downloads: dict[str, bytes] = {}
        self.arrived: dict[str, bool] = {}  # whether the server has acknowledged the whole upload
        self._transfers: dict[str, tuple[str, int]] = {}
        self._parts: dict[str, dict[int, bytes]] = {}
        self.camera: list[float] = []  # its position [m]
        self.frames = 0
        self.send(
            type="ViewerCameraMessage",
            wxyz=[1.0, 0.0, 0.0, 0.0],
            position=[0.0, -1.0, 1.0],
            fov=0.8,
            near=0.01,
            far=100.0,
            image_height=600,
            image_width=900,
            look_at=[0.0, 0.0, 0.0],
            up_direction=[0.0, 0.0, 1.0],
        )

    def __enter__(self) -> "SceneClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, **message: Any) -> None:
        self.socket.send(msgspec.msgpack.encode(message))

    def wait_for(self, condition: Callable[[], Any], timeout: float = 20.0) -> Any:
        """Process messages until `condition` holds; return its value."""
        give_up = time.monotonic() + timeout
        while not (value := condition()):
            remaining = give_up - time.monotonic()
            assert remaining > 0, "the scene did not get there in time"
            try:
                self._take(self.socket.recv(timeout=min(remaining, 1.0)))
            except TimeoutError:
                continue
        return value

    def take_one(self, seconds: float) -> None:
        """Process the next frame, if it comes in time."""
        with contextlib.suppress(TimeoutError):
            self._take(self.socket.recv(timeout=seconds))

    def listen(self, seconds: float) -> None:
        """Process messages for a while."""
        give_up = time.monotonic() + seconds
        while (remaining := give_up - time.monotonic()) > 0:
            try:
                self._take(self.socket.recv(timeout=remaining))
            except TimeoutError:
                return

    def _take(self, frame: bytes | str) -> None:
        assert isinstance(frame, bytes)
        self.frames += 1
        for message in decode(frame):
            kind, name = message["type"], message.get("name", "")
            if kind == "SceneNodeUpdateMessage":
                self.nodes.setdefault(name, {}).update(message["updates"])
            elif kind == "GuiUpdateMessage":
                self.controls[message["uuid"]].update(message["updates"])
            elif kind == "RemoveSceneNodeMessage":
                self.nodes.pop(name, None)
            elif kind == "SetPositionMessage":
                self.positions[name] = message["position"]
            elif kind == "SetCameraPositionMessage":
                self.camera = message["position"]
            elif kind == "SetSceneNodeVisibilityMessage":
                self.visible[name] = message["visible"]
            elif kind == "NotificationShowMessage":
                self.notifications.append(message["props"]["title"])
                self.notices.append(message["props"]["body"])
            elif kind == "FileTransferStartDownload":
                self._transfers[message["transfer_uuid"]] = (message["filename"], message["part_count"])
            elif kind == "FileTransferPartAck":
                self.arrived[message["transfer_uuid"]] = message["transferred_bytes"] >= message["total_bytes"]
            elif kind == "FileTransferPart":
                self._take_part(message)
            elif kind.startswith("Gui") and "props" in message:
                value = {"value": message["value"]} if "value" in message else {}
                self.controls[message["uuid"]] = {"kind": kind, **message["props"], **value}
            elif "props" in message and name:
                self.nodes[name] = dict(message["props"])
                self.owners[name] = message.get("owner", "")

    def _take_part(self, message: dict[str, Any]) -> None:
        """Add a part of a download, which is kept once it is complete."""
        uuid = message["transfer_uuid"]
        parts = self._parts.setdefault(uuid, {})
        parts[message["part_index"]] = bytes(message["content"])
        filename, count = self._transfers[uuid]
        if len(parts) == count:
            self.downloads[filename] = b"".join(parts[k] for k in range(count))

    def control(self, label: str) -> tuple[str, dict[str, Any]]:
        """Return the id and the state of the control with this label."""
        return next((uuid, state) for uuid, state in self.controls.items() if state.get("label") == label)

    def set(self, label: str, value: Any) -> None:
        """Set a control like a user."""
        self.send(type="GuiUpdateMessage", uuid=self.control(label)[0], updates={"value": value})

    def press(self, label: str) -> None:
        """Press a button."""
        self.set(label, True)

    @property
    def card(self) -> str:
        """The status card's HTML."""
        return next((c["content"] for c in self.controls.values() if "data-status" in c.get("content", "")), "")

    def html(self, mark: str) -> str:
        """The HTML of the element that contains `mark`; empty if there is none."""
        return next((c["content"] for c in self.controls.values() if mark in c.get("content", "")), "")

    def markdown(self, mark: str) -> str:
        """The Markdown of the element that contains `mark`; empty if there is none."""
        return next((c["_markdown"] for c in self.controls.values() if mark in c.get("_markdown", "")), "")

    @property
    def document(self) -> dict[str, Any]:
        """The scene as it would be downloaded now."""
        self.downloads.clear()
        self.press("Download scene.json")
        names = self.wait_for(lambda: [name for name in self.downloads if name.endswith("scene.json")])
        return json.loads(self.downloads[names[0]])

    def refined(self) -> None:
        """Wait until the picture shows a prediction at the requested quality."""
        self.wait_for(lambda: "control points" in self.card and "Preview" not in self.card)

    def upload(self, label: str, name: str, content: bytes) -> None:
        """Open a file by the button with this label."""
        self.send_part(label, self.begin_upload(label, name, len(content)), 0, content)

    def begin_upload(self, label: str, name: str, size: int, *, parts: int = 1) -> str:
        """Announce a file of `size` bytes in so many parts to the button with this label; return its id."""
        transfer = str(uuid4())
        self.send(
            type="FileTransferStartUpload",
            source_component_uuid=self.control(label)[0],
            transfer_uuid=transfer,
            filename=name,
            mime_type="application/octet-stream",
            part_count=parts,
            size_bytes=size,
        )
        return transfer

    def send_part(self, label: str, transfer: str, index: int, content: bytes) -> None:
        """Send a part of an announced file."""
        self.send(
            type="FileTransferPart",
            source_component_uuid=self.control(label)[0],
            transfer_uuid=transfer,
            part_index=index,
            content=content,
        )

    def click(self, point: Any) -> None:
        """Click on what lies at a point (3,) [m], seen from above it."""
        eye = [float(point[0]), float(point[1]), float(point[2]) + 2.0]
        self.send(
            type="ScenePointerMessage",
            event_type="click",
            ray_origin=eye,
            ray_direction=[0.0, 0.0, -1.0],
            screen_pos=[[0.5, 0.5]],
            modifier=None,
        )

    def drag_node(self, phase: str, name: str, instance: int, end: list[float]) -> None:
        """Start, move or end a drag of an instance of a node; `end` is on the plane that faces the camera [m]."""
        self.send(
            type="SceneNodeDragMessage",
            phase=phase,
            name=name,
            instance_index=instance,
            start_position=end,
            start_screen_pos=[0.5, 0.5],
            end_position=end,
            end_screen_pos=[0.5, 0.5],
            button="left",
            modifier=None,
            owner=self.owners[name],
        )

    def drag(self, phase: str, x: float = 0.0, y: float = 0.0, z: float = 0.0, wxyz: Any = IDENTITY) -> None:
        """Start, move or end a drag of the target."""
        kind = {"start": "DragStart", "update": "Update", "end": "DragEnd"}[phase]
        pose = {"wxyz": [float(x) for x in wxyz], "position": [x, y, z]} if phase == "update" else {}
        self.send(type=f"TransformControls{kind}Message", name="/target", owner=self.owners["/target"], **pose)

    @property
    def final_shape(self) -> np.ndarray:
        """The last row of the drawn surface; (columns, 3) [m]."""
        return self.nodes["/surface/7"]["vertices"].reshape(-1, 49, 3)[-1]

    @property
    def cable(self) -> np.ndarray:
        """Centres of the drawn cable's segments; (segments, 3) [m]."""
        return self.nodes["/cable"]["batched_positions"].reshape(-1, 3)


def connected(service: Any, example: str = "new", tab: str = "", **options: Any) -> SceneClient:
    """Return a client that sees its first prediction: of a ready scene, the paper's case, or the scene of a tab."""
    path = f"/scene/{example}/{tab}" if tab else httpx.get(f"{service.address}/scene/{example}/").headers["location"]
    return opened(service, path, **options)


def opened(service: Any, path: str, **options: Any) -> SceneClient:
    """Return a client of the scene whose page is at `path`, which sees its first prediction."""
    client = SceneClient(service.address.replace("http", "ws") + path.rstrip("/"), **options)
    # a frame has at most 128 messages: the picture may come in a later frame than the card
    client.wait_for(lambda: "control points" in client.card and "/cable" in client.nodes and client.final_shape.any())
    return client


def NOTHING_STORED(_id: str) -> None:  # noqa: N802 - a constant, as far as scenes are concerned
    """Find no stored motion."""

"""Limits on the files that a client is uploading, which viser keeps in memory until they are whole."""

from collections.abc import Callable
from typing import Any

from viser import ClientHandle
from viser._messages import FileTransferPart, FileTransferPartAck, FileTransferStartUpload

from app.viewer import tracked, uploads
from dlocore import SceneError

LARGEST = max(uploads.LARGEST, tracked.LARGEST)  # bytes of a file
MOST_AT_ONCE = 2  # files: the page has two buttons, and each uploads one


def limit_uploads(client: ClientHandle, refuse: Callable[[str, SceneError], object]) -> None:
    """Drop an upload as soon as it is too large, or one too many; `refuse` takes its name and the reason.

    viser handles each message before this does. Both the announced size and what has arrived count.
    """
    under_way = client.gui._current_file_upload_states

    def check(_client_id: int, message: Any) -> None:
        upload = under_way.get(message.transfer_uuid)
        if upload is None:
            return
        size = max(upload["total_bytes"], upload["transferred_bytes"])
        if size > LARGEST:
            problem = SceneError("file", f"{size} bytes", f"at most {LARGEST} bytes")
        elif len(under_way) > MOST_AT_ONCE:
            problem = SceneError("file", f"{len(under_way)} files at once", f"at most {MOST_AT_ONCE}")
        else:
            return
        del under_way[message.transfer_uuid]
        # the page frees its button only when it believes that the file has arrived; it goes on sending either way
        client._websock_connection.queue_message(
            FileTransferPartAck(message.source_component_uuid, message.transfer_uuid, size, size)
        )
        refuse(upload["filename"], problem)

    for kind in (FileTransferStartUpload, FileTransferPart):
        client._websock_connection.register_handler(kind, check)

"""Extract the web viewer that ships inside rerun's wheel, as files.

The viewer is compiled into the wheel's command line program, and the only way to get its files is to request them from
that program. So the program is started once, on the loopback address and for less than a second, and the files are kept
in the data directory.
"""

import os
import secrets
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from importlib.metadata import files, version
from pathlib import Path
from threading import Lock

FILES = {
    "index.html": "text/html; charset=utf-8",
    "re_viewer.js": "text/javascript",
    "re_viewer_bg.wasm": "application/wasm",
    "favicon.ico": "image/x-icon",
}
_START_TIMEOUT = 20.0  # s
_lock = Lock()


def viewer_files(data_dir: Path) -> Path:
    """Return the directory with the viewer's files, which the first call creates.

    Raises:
        RuntimeError: rerun's program did not serve the files.
    """
    directory = data_dir / f"rerun-viewer-{version('rerun-sdk')}"
    with _lock:
        if not directory.is_dir():
            data_dir.mkdir(parents=True, exist_ok=True)
            temporary = data_dir / f".viewer-{secrets.token_hex(4)}"
            temporary.mkdir()
            try:
                _unpack(temporary)
                temporary.rename(directory)
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
    return directory


def _program() -> Path:
    for file in files("rerun-sdk") or ():
        if str(file) == "rerun_cli/rerun":
            return Path(str(file.locate()))
    raise RuntimeError("The installed rerun-sdk has no command line program, and so no web viewer")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _unpack(directory: Path) -> None:
    port = _free_port()
    # With an address to view, it serves only the viewer; that address is never requested. CI switches its telemetry
    # off, and a temporary home keeps its settings out of the user's home.
    arguments = ["--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(port), "http://127.0.0.1:9/none.rrd"]
    with tempfile.TemporaryDirectory() as home:
        process = subprocess.Popen(
            [_program(), *arguments],
            env={**os.environ, "CI": "true", "HOME": home, "XDG_CONFIG_HOME": home},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            for name in FILES:
                (directory / name).write_bytes(_get(f"http://127.0.0.1:{port}/{name}", process))
        finally:
            process.kill()  # it does not stop when asked to
            process.wait()


def _get(address: str, process: "subprocess.Popen[bytes]") -> bytes:
    give_up = time.monotonic() + _START_TIMEOUT
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    while True:
        try:
            with opener.open(address, timeout=_START_TIMEOUT) as response:
                return bytes(response.read())
        except urllib.error.HTTPError as error:
            raise RuntimeError(f"rerun's web viewer has no {address}") from error
        except OSError as error:
            if process.poll() is not None or time.monotonic() > give_up:
                raise RuntimeError("rerun's program did not serve its web viewer") from error
            time.sleep(0.05)

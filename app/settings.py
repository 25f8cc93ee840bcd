"""Settings of the service, from environment variables that begin with ``DLO_``."""

import re
from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr, field_validator
from pydantic_core import PydanticCustomError
from pydantic_settings import BaseSettings, SettingsConfigDict

from dlocore.calibration import FILE
from dlocore.machine import usable_cores, user_data_dir

_ORIGIN = re.compile(r"([a-z][a-z0-9+.-]*)://(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?")
_TOKEN = 8  # least characters of a token
_PORTS = {"http": ":80", "https": ":443"}  # default ports, which a browser leaves out


class Settings(BaseSettings):
    """Where the service listens and stores runs, and its limits. ``DLO_PORT=9000`` sets `port`, and so on."""

    model_config = SettingsConfigDict(env_prefix="DLO_", frozen=True, extra="ignore")

    host: str = Field(
        default="127.0.0.1",
        min_length=1,
        description="Address to listen on; by default only this machine can reach it.",
    )
    port: int = Field(default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one.")
    data_dir: Path = Field(default_factory=user_data_dir, description="Directory of the stored runs.")
    max_body_bytes: int = Field(default=10_000_000, ge=1_000, description="Largest request body [bytes].")
    workers: int = Field(default_factory=usable_cores, ge=1, le=1024, description="Solves that run at once.")
    queue_size: int = Field(default=64, ge=0, le=100_000, description="Solves that may wait for a worker.")
    max_batch: int = Field(default=1000, ge=1, le=100_000, description="Scenes in one batch.")
    time_limit: float = Field(default=60.0, gt=0.0, le=86_400.0, description="Longest solve [s].")
    allowed_origins: tuple[str, ...] = Field(
        default=(), description='Other origins whose pages may call the API, as JSON: ["https://lab.example"].'
    )
    token: SecretStr | None = Field(
        default=None, description="Bearer token that every request must carry; absent: no token is needed."
    )
    shutdown_grace: float = Field(
        default=5.0, ge=0.0, le=3600.0, description="Time for running solves to finish when the service stops [s]."
    )
    log_format: Literal["json", "text"] = Field(default="json", description="Form of the log on standard error.")
    max_scenes: int = Field(default=16, ge=1, le=1000, description="Tabs of the 3D scene that may be open at once.")
    max_runs: int = Field(
        default=1000, ge=1, description="Largest number of stored runs; the oldest are removed first."
    )
    max_run_bytes: int = Field(
        default=2_000_000_000, ge=1_000_000, description="Largest total size of stored runs [bytes]."
    )

    @property
    def calibration_file(self) -> Path:
        """Where the calibration of this machine is stored."""
        return self.data_dir / FILE

    @field_validator("allowed_origins")
    @classmethod
    def _as_browsers_send_them(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(_origin(text) for text in value)

    @field_validator("token")
    @classmethod
    def _hard_to_guess(cls, value: SecretStr | None) -> SecretStr | None:
        if value is not None and len(value) < _TOKEN:
            told = {"given": len(value), "least": _TOKEN}
            raise PydanticCustomError("token", "It has {given} characters, and needs at least {least}", told)
        return value

    @field_validator("data_dir")
    @classmethod
    def _absolute(cls, value: Path) -> Path:
        return value.expanduser().absolute()


def _origin(text: str) -> str:
    """Return an origin as browsers send it: in lower case, without a trailing slash or the default port."""
    origin = text.lower().removesuffix("/")
    if origin in ("*", "null"):  # any origin, and that of a page from a file
        return origin
    parts = _ORIGIN.fullmatch(origin)
    if parts is None:
        told = {"text": repr(text)}
        raise PydanticCustomError(
            "origin", "{text} is not an origin such as https://host or http://host:port, without a path", told
        )
    return origin.removesuffix(_PORTS.get(parts[1], ""))

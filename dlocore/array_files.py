"""Arrays in NumPy's own files, which may be damaged, or far larger once unpacked."""

import lzma
import math
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError

# what zipfile and numpy raise for damaged files; MemoryError if a damaged header announces a huge array
_DAMAGED = (
    ValueError, OSError, EOFError, RuntimeError, MemoryError, SyntaxError, tokenize.TokenError,
    zipfile.BadZipFile, zlib.error, lzma.LZMAError,
)  # fmt: skip
_ALLOWED = "a NumPy .npz file of numbers and text"


@contextmanager
def _unpacking(name: str, allowed: str) -> Iterator[None]:
    try:
        yield
    except _DAMAGED as error:
        raise SceneError(name, f"a file that can't be unpacked: {str(error)[:80]}", allowed) from error


def read_array(file: BinaryIO, name: str) -> NDArray[Any]:
    """Return the array of a `.npy`.

    Args:
        file: its content.
        name: its name in errors.

    Raises:
        SceneError: it is not a `.npy`, is damaged, or holds objects.
    """
    with _unpacking(name, "a file that numpy.save or numpy.savez wrote"):
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))


class ArrayFile:
    """The arrays of a `.npz`, each unpacked when it is read; the file must stay open for that.

    Args:
        file: its content.
        name: its name in errors.
        largest: largest size of an unpacked array [bytes].

    Attributes:
        names: of the arrays.

    Raises:
        SceneError: it is not a `.npz`, or is damaged.
    """

    def __init__(self, file: BinaryIO, name: str, largest: float = math.inf) -> None:
        if not zipfile.is_zipfile(file):
            raise SceneError(name, "a file that is not an archive, or is truncated", _ALLOWED)
        with _unpacking(name, _ALLOWED):
            self._archive = zipfile.ZipFile(file)
        self._name, self._largest = name, largest
        self._members = {info.filename.removesuffix(".npy"): info for info in self._archive.infolist()}
        self.names = tuple(self._members)

    def read(self, name: str) -> NDArray[Any]:
        """Return an array, one of `names`.

        Raises:
            SceneError: it is too large, or damaged, or holds objects.
        """
        member = self._members[name]
        if member.file_size > self._largest:
            raise SceneError(f"{self._name}, {name}", f"{member.file_size} bytes", f"at most {self._largest} bytes")
        with _unpacking(self._name, _ALLOWED), self._archive.open(member) as content:
            return np.asarray(np.lib.format.read_array(content, allow_pickle=False))

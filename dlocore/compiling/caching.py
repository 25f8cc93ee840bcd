"""A cache of compiled code on disk that processes may fill at once."""

import hashlib
import pickle
import uuid
from pathlib import Path
from typing import Any, BinaryIO

import numba
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl
from numba.core.serialize import dumps

FORMAT = 2  # of what is kept: counted up where it changes
_NO_BITCODE = binding.parse_assembly("").as_bitcode()


class UnreadBitcode(CompileResultCacheImpl):  # type: ignore[misc]  # numba has no types
    """What is kept of a compiled function: its code, the names in it, and its bitcode.

    The bitcode is for compiling callers, into which it is inlined. numba parses it for each function that it loads, and
    looks up all names in it, which takes three quarters of the time; here only what is called by something that has
    to be compiled is parsed.
    """

    def reduce(self, result: Any) -> Any:
        """Return what is to be written of a compiled function."""
        module = result.library._get_module_for_linking()
        defined = {v.name for v in (*module.functions, *module.global_variables) if not v.is_declaration}
        return defined, super().reduce(result)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the compiled function of which `reduce` returned a payload."""
        defined, ((name, kind, (code, bitcode)), *rest) = payload
        target_context.codegen()._engine._defined_symbols.update(defined)
        result = super().rebuild(target_context, ((name, kind, (code, _NO_BITCODE)), *rest))
        library = result.library
        library._shared_module = None

        def for_linking() -> Any:
            if library._shared_module is None:
                library._shared_module = binding.parse_bitcode(bitcode)
            return library._shared_module

        library._get_module_for_linking = for_linking
        return result


class OverloadFiles:
    """The files of one function's compiled code, one for each signature, in the place of numba's index of them.

    numba numbers them in its index. Of two processes that compile a function for two signatures at once both take the
    same number: the index names one file for one of the two, and the file may hold the code of the other, which then
    runs on arguments that it was not compiled for. Here the name follows from the signature, and whoever writes it last
    writes the same.
    """

    def __init__(self, folder: str, name: str, source: str) -> None:
        """Keep what is compiled of `source`, a hash, in `folder`, in files whose names begin with `name`."""
        self._folder, self._name = Path(folder), name
        self._stamp = f"{numba.__version__} {FORMAT} {source}\n".encode()

    def load(self, key: Any) -> Any:
        """Return what was saved for `key`, or None where that is nothing, or of another source."""
        try:
            with self._path(key).open("rb") as file:
                if not self._is_of_source(file):
                    return None
                saved_key, data = pickle.load(file)
        except FileNotFoundError:
            return None
        return data if saved_key == key else None

    def any(self) -> bool:
        """Return whether something of the present source is kept."""
        for path in self._folder.glob(f"{self._name}.*.nbc"):
            with path.open("rb") as file:
                if self._is_of_source(file):
                    return True
        return False

    def save(self, key: Any, data: Any) -> None:
        """Keep `data` for `key`: who reads meanwhile reads all of it or none."""
        path = self._path(key)
        written = path.with_suffix(f".{uuid.uuid4().hex[:16]}")
        try:
            with written.open("wb") as file:
                file.write(self._stamp)
                file.write(dumps((key, data)))
            written.replace(path)
        except BaseException:
            written.unlink(missing_ok=True)
            raise

    def flush(self) -> None:
        """Forget all that was saved."""
        for path in self._folder.glob(f"{self._name}.*.nbc"):
            path.unlink(missing_ok=True)

    def _is_of_source(self, file: BinaryIO) -> bool:
        """Read the stamp that a file begins with: what is of another source, or numba's own, is not unpickled."""
        return file.read(len(self._stamp)) == self._stamp

    def _path(self, key: Any) -> Path:
        return self._folder / f"{self._name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"


def kept(compiled: Any, source: str) -> Any:
    """Return `compiled`, a function of numba's with a cache, that keeps its code in `OverloadFiles` of `source`."""
    if hasattr(compiled, "_cache"):  # not where compilation is switched off for debugging
        cache = compiled._cache
        cache._impl = UnreadBitcode(compiled.py_func)
        cache._cache_file = OverloadFiles(cache.cache_path, cache._impl.filename_base, source)
    return compiled


def is_kept(compiled: Any) -> bool:
    """Return whether code of `compiled` that its present source was compiled to is on disk, for any signature."""
    return not hasattr(compiled, "_cache") or compiled._cache._cache_file.any()

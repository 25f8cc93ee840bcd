"""A cache of compiled code on disk that several processes may fill at the same time."""

import hashlib
import pickle
import uuid
from pathlib import Path
from typing import Any, BinaryIO

import numba
from llvmlite import binding
from numba.core.caching import CompileResultCacheImpl
from numba.core.serialize import dumps

FORMAT = 2  # version of the saved data: increase it when they change
_NO_BITCODE = binding.parse_assembly("").as_bitcode()


class UnreadBitcode(CompileResultCacheImpl):  # type: ignore[misc]  # numba has no types
    """The saved form of a compiled function: its code, the names in it, and its bitcode.

    The bitcode serves to inline the function into callers that are compiled. numba parses it for every function that it
    loads, and looks up all names in it, which takes three quarters of the loading time. Here it is parsed only if
    something that must be compiled calls the function.
    """

    def reduce(self, result: Any) -> Any:
        """Return the data to save of a compiled function."""
        module = result.library._get_module_for_linking()
        defined = {v.name for v in (*module.functions, *module.global_variables) if not v.is_declaration}
        return defined, super().reduce(result)

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the compiled function from the data that `reduce` returned."""
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
    """The files of one function's compiled code, one for each signature, in place of numba's index of them.

    numba numbers the files in its index. If two processes compile a function for two signatures at the same time, both
    take the same number: the index names one file for one of the signatures, but that file may hold the code of the
    other, which then runs on arguments that it was not compiled for. Here the signature determines the name of the
    file, so that it does not matter which process writes last.
    """

    def __init__(self, folder: str, name: str, source: str) -> None:
        """Keep code compiled from `source`, a hash, in `folder`, in files whose names begin with `name`."""
        self._folder, self._name = Path(folder), name
        self._stamp = f"{numba.__version__} {FORMAT} {source}\n".encode()

    def load(self, key: Any) -> Any:
        """Return what was saved for `key`, or None if there is nothing, or only that of another source."""
        try:
            with self._path(key).open("rb") as file:
                if not self._is_of_source(file):
                    return None
                saved_key, data = pickle.load(file)
        except FileNotFoundError:
            return None
        return data if saved_key == key else None

    def any(self) -> bool:
        """Return whether anything compiled from the present source is saved."""
        for path in self._folder.glob(f"{self._name}.*.nbc"):
            with path.open("rb") as file:
                if self._is_of_source(file):
                    return True
        return False

    def save(self, key: Any, data: Any) -> None:
        """Save `data` for `key`; a concurrent reader reads all of it or nothing."""
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
        """Delete everything that was saved."""
        for path in self._folder.glob(f"{self._name}.*.nbc"):
            path.unlink(missing_ok=True)

    def _is_of_source(self, file: BinaryIO) -> bool:
        """Tell whether a file begins with the stamp of this source; others, as numba's own, are not unpickled."""
        return file.read(len(self._stamp)) == self._stamp

    def _path(self, key: Any) -> Path:
        return self._folder / f"{self._name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"


def kept(compiled: Any, source: str) -> Any:
    """Return the cached numba function `compiled`, changed to keep its code in `OverloadFiles` of `source`."""
    if hasattr(compiled, "_cache"):  # false where compilation is switched off for debugging
        cache = compiled._cache
        cache._impl = UnreadBitcode(compiled.py_func)
        cache._cache_file = OverloadFiles(cache.cache_path, cache._impl.filename_base, source)
    return compiled


def is_kept(compiled: Any) -> bool:
    """Return whether code of `compiled` for its present source is on disk, for any signature."""
    return not hasattr(compiled, "_cache") or compiled._cache._cache_file.any()

"""Errors of the predictor and the checks that raise them.

Bad input is an exception that names the field, the value and what is allowed. Not converging is a result
(`Prediction.status`), never an exception.
"""

from collections.abc import Hashable, Iterable, Iterator
from contextlib import contextmanager
from types import UnionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

T = TypeVar("T", bound=Hashable)
Kind = type | UnionType

MILLIMETRES = "Lengths are in metres, and this looks like millimetres"  # why something is far too large


class DloError(Exception):
    """Anything this package raises on purpose."""


class SceneError(DloError, ValueError):
    """A scene that can't be solved as it was given.

    Attributes:
        field: path of the field, e.g. ``primitives[0].u``.
        given: the value, shortened for reading.
        allowed: what would be accepted, in words.
        reason: what is wrong, in words; "" if `given` and `allowed` say enough.
    """

    def __init__(self, field: str, given: Any, allowed: str, reason: str = "") -> None:
        self.field = field
        self.given = _shorten(given)
        self.allowed = allowed
        self.reason = reason
        super().__init__(str(self))

    def __str__(self) -> str:
        why = f" {self.reason}." if self.reason else ""
        return f"{self.field}: got {self.given}.{why} Allowed: {self.allowed}."

    def __reduce__(self) -> tuple[type["SceneError"], tuple[str, str, str, str]]:
        return (type(self), (self.field, self.given, self.allowed, self.reason))


class Cancelled(DloError):  # noqa: N818 - named for what happened
    """The caller asked a running solve to stop."""


def _shorten(value: Any) -> str:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


def _typed(value: Any) -> Any:
    """Return a value of a wrong type as it is typed: text in quotes, since bare text could look like a valid value."""
    return repr(value) if isinstance(value, str) else value


def repeated(values: Iterable[T]) -> T | None:
    """Return the first value that occurs a second time, or None if all values differ."""
    seen = set()
    for value in values:
        if value in seen:
            return value
        seen.add(value)
    return None


@contextmanager
def within(prefix: str) -> Iterator[None]:
    """Prefix the field of any SceneError raised inside, so that nested parts report their full path."""
    try:
        yield
    except SceneError as error:
        raise SceneError(f"{prefix}.{error.field}", error.given, error.allowed, error.reason) from None


@contextmanager
def calculable(field: str, given: Any, allowed: str, reason: str) -> Iterator[None]:
    """Turn arithmetic errors raised inside, as from numbers of extremely different scales, into this SceneError."""
    try:
        yield
    except SceneError:
        raise
    except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        raise SceneError(field, given, allowed, reason) from error


def number(
    field: str,
    value: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    unit: str = "",
) -> float:
    """Return `value` as a float, or raise SceneError unless it is a finite number in the allowed range."""
    bounds = [
        f"above {above:g}" if above is not None else "",
        f"at least {at_least:g}" if at_least is not None else "",
        f"at most {at_most:g}" if at_most is not None else "",
    ]
    allowed = " ".join(["a finite number", *[b for b in bounds if b]]) + (f" [{unit}]" if unit else "")
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.integer | np.floating):
        raise SceneError(field, _typed(value), allowed)
    try:
        x = float(value)
    except OverflowError:
        raise SceneError(field, value, allowed) from None
    inside = (
        np.isfinite(x)
        and (above is None or x > above)
        and (at_least is None or x >= at_least)
        and (at_most is None or x <= at_most)
    )
    if not inside:
        raise SceneError(field, value, allowed)
    return x


def whole(field: str, value: Any, *, at_least: int, at_most: int | None = None) -> int:
    """Return `value` as an int, or raise SceneError unless it is an integer in the allowed range."""
    integer = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not integer or value < at_least or (at_most is not None and value > at_most):
        allowed = f"at least {at_least}" if at_most is None else f"{at_least} to {at_most}"
        raise SceneError(field, _typed(value), f"an integer, {allowed}")
    return int(value)


def unmasked(value: ArrayLike) -> ArrayLike:
    """Return `value` with NaN for the masked numbers of masked arrays, alone or in lists of any depth."""
    if isinstance(value, np.ma.MaskedArray):
        return np.where(np.ma.getmaskarray(value), np.nan, value.data) if value.dtype.kind in "fiu" else value
    if not isinstance(value, list | tuple) or not value or isinstance(value[0], int | float):
        return value
    rows: list[Any] = [unmasked(row) for row in value]
    return cast(ArrayLike, value if all(row is given for row, given in zip(rows, value, strict=True)) else rows)


def array(field: str, value: ArrayLike, *, shape: tuple[int | None, ...], unit: str = "") -> NDArray[np.float64]:
    """Return `value` as a read-only float array of `shape` (None: any length), or raise SceneError.

    The masked values of a masked array count as NaN, and are refused.
    """
    sizes = " x ".join("n" if n is None else str(n) for n in shape)
    allowed = f"finite numbers, {sizes}" + (f" [{unit}]" if unit else "")
    try:
        raw = np.asarray(unmasked(value))
    except ValueError:
        raise SceneError(field, value, allowed, "The rows differ in length") from None
    if raw.dtype.kind not in "fiu":
        raise SceneError(field, _typed(value), allowed)
    x = np.array(raw, dtype=float)
    if x.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, x.shape, strict=True)):
        raise SceneError(field, f"shape {x.shape}", allowed)
    if not np.isfinite(x).all():
        where = [int(i) for i in np.argwhere(~np.isfinite(x))[0]]
        raise SceneError(field + "".join(f"[{i}]" for i in where), float(x[tuple(where)]), allowed)
    x.setflags(write=False)
    return x


def columns_of(value: Any) -> int:
    """Return the length of the rows of `value`, 0 if it is not a table of equal rows."""
    try:
        shape = np.shape(value)
    except ValueError:
        return 0
    return int(shape[1]) if len(shape) == 2 else 0


def points_array(field: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return points (n, 3) [m] of the points (n, 2 or 3) `value`, 2D points at z = 0, or raise SceneError."""
    points = array(field, value, shape=(None, 2 if columns_of(value) == 2 else 3), unit="m")
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
        points.setflags(write=False)
    return points


def instance(field: str, value: Any, kind: Kind, allowed: str) -> None:
    """Raise SceneError unless `isinstance(value, kind)`; `allowed` says in words what is."""
    if not isinstance(value, kind):
        raise SceneError(field, _typed(value), allowed)


def instances(field: str, values: Any, kind: Kind, allowed: str) -> tuple[Any, ...]:
    """Return the iterable `values` as a tuple, or raise SceneError unless each is of a `kind` (see `instance`)."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise SceneError(field, _typed(values), f"a list of {allowed}")
    found = tuple(values)
    for i, value in enumerate(found):
        instance(f"{field}[{i}]", value, kind, allowed)
    return found


def flag(field: str, value: Any) -> None:
    """Raise SceneError unless `value` is True or False."""
    instance(field, value, bool | np.bool_, "True or False")


def choice(field: str, value: Any, options: tuple[str, ...]) -> str:
    """Return `value`, or raise SceneError unless it is one of `options`."""
    if not isinstance(value, str) or value not in options:
        raise SceneError(field, value, "one of " + ", ".join(options))
    return value

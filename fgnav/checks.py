"""Errors, and the one gate that turns data from outside into read-only arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.floating[Any]]
_LONGEST_QUOTE = 80  # characters: what is wrong shows at once, and no file is printed whole

IntArray: TypeAlias = NDArray[np.integer[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]


class FgnavError(Exception):
    """Base of every error raised on purpose by this project.

    Examples
    --------
    >>> import fgnav
    >>> issubclass(fgnav.BadInputError, fgnav.FgnavError)
    True
    """


class BadInputError(FgnavError, ValueError):
    """The caller passed data that breaks a stated rule; the text names what, where and the mend.

    Examples
    --------
    >>> import fgnav
    >>> try:
    ...     fgnav.load_flight("nowhere")
    ... except fgnav.BadInputError as error:
    ...     print(error)
    nowhere/flight.toml: no such file; a flight is a folder with a flight.toml
    """


class NoSolutionError(FgnavError):
    """The data are valid, but there is no answer; the text names the state that is missing.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> try:
    ...     fgnav.Smoother()(replace(flight, observations=None))
    ... except fgnav.NoSolutionError as error:
    ...     print(error)
    attitude: flight demo has no antenna array, no raw data, no fixes
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class Unused:
    """Something that was measured and is not used: what, why, how often.

    Attributes
    ----------
    what : str
        The kind of thing, with its owner: ``"a2 G05 1C link"``, ``"GLONASS observation"``.
    reason : str
        Why it is not used, in words a user can act on.
    count : int
        How many were lost.
    """

    what: str
    reason: str
    count: int


def unused_of(counts: Mapping[tuple[str, str], int]) -> tuple[Unused, ...]:
    """Return unused by what and reason, each with its count; none of zero."""
    return tuple(Unused(what=w, reason=r, count=int(n)) for (w, r), n in counts.items() if n > 0)


def quoted(value: object) -> str:
    """Return a value for an error's text: as Python writes it, printable, 80 characters at most."""
    text = ascii(value) if isinstance(value, str) and not value.isprintable() else repr(value)
    return text if len(text) <= _LONGEST_QUOTE else f"{text[: _LONGEST_QUOTE - 3]}..."


def frozen(
    name: str,
    value: ArrayLike,
    shape: tuple[int | None, ...],
    *,
    dtype: type = np.float64,
    gaps: bool = False,
) -> NDArray[Any]:
    """Return a read-only copy of ``value`` after checking it.

    Parameters
    ----------
    name : str
        Name used in the error text.
    value : array_like
        Data from outside.
    shape : tuple of int or None
        Required shape; None accepts any length.
    dtype : type
        Element type of the copy.
    gaps : bool
        Accept NaN, which then means "not measured". Infinity is never accepted.

    Returns
    -------
    ndarray, shape ``shape``
        Read-only copy.

    Raises
    ------
    BadInputError
        If the shape differs or a value is not finite.
    """
    array: NDArray[Any] = np.array(value, dtype=dtype)
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        raise BadInputError(f"{name}: expected shape {shape}, got {array.shape}")
    if array.dtype.kind == "f":
        wrong = np.isinf(array) if gaps else ~np.isfinite(array)
        if wrong.any():
            index = int(np.argwhere(wrong)[0][0]) if array.ndim else 0
            raise BadInputError(f"{name}: not finite, first at row {index}")
    array.flags.writeable = False
    return array


def freeze(
    owner: str,
    item: object,
    shapes: Mapping[str, tuple[int | None, ...]],
    *,
    dtype: type = np.float64,
    gaps: bool = False,
) -> None:
    """Put each named field of a frozen data type through ``frozen``.

    Parameters
    ----------
    owner : str
        What the data type is, before the field's name in the error text.
    item : object
        The data type, within its ``__post_init__``.
    shapes : mapping of str to tuple
        Required shape by field; shape, dtype and gaps as of ``frozen``.

    Raises
    ------
    BadInputError
        As ``frozen``, of the first field that breaks its rule.
    """
    for name, shape in shapes.items():
        array = frozen(f"{owner} {name}", getattr(item, name), shape, dtype=dtype, gaps=gaps)
        object.__setattr__(item, name, array)


def increasing(name: str, t_s: FloatArray) -> None:
    """Raise unless times increase strictly.

    Raises
    ------
    BadInputError
        Naming the first row whose time does not follow the one before.
    """
    steps_s = np.diff(t_s)
    if (steps_s <= 0).any():
        k = int(np.argmax(steps_s <= 0)) + 1
        raise BadInputError(
            f"{name}: time must increase, row {k} has {t_s[k]:.6f} after {t_s[k - 1]:.6f}"
        )


def freeze_times(owner: str, item: object) -> int:
    """Freeze the field ``t_s`` of a data type, and return how many times it holds.

    Raises
    ------
    BadInputError
        If the times are not one finite column that increases strictly.
    """
    freeze(owner, item, {"t_s": (None,)})
    t_s: FloatArray = getattr(item, "t_s")  # noqa: B009  # a field of any data type
    increasing(f"{owner} t_s", t_s)
    return len(t_s)


def positive(name: str, value: float) -> None:
    """Raise unless a scalar is finite and above zero.

    Raises
    ------
    BadInputError
        Naming the field and its value.
    """
    if not (np.isfinite(value) and value > 0):
        raise BadInputError(f"{name}: must be positive, got {value}")

"""An estimate on disk without loss: arrays as they are, in an npz file that holds no objects."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import msgspec
import numpy as np

from fgnav.checks import BadInputError
from fgnav.geometry.earth import Origin
from fgnav.io.atomic_write import atomic_file
from fgnav.types.estimate import Estimate, Verdict
from fgnav.types.flight import Flight

FILE = "estimate.npz"
_FORMAT = "fgnav estimate 2"


class _Head(msgspec.Struct, kw_only=True):
    """Fields that are no arrays; those of ``Estimate`` have its names."""

    format: str
    flight: str
    start_gps_s: float
    origin: Origin
    method: str
    n_epochs: int
    converged: bool
    unobservable: tuple[str, ...]
    notes: tuple[str, ...]
    verdicts: tuple[Verdict, ...]


_OF_ESTIMATE = _Head.__struct_fields__[4:]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RecordedEstimate:
    """An estimate with what fixes its frame and its clock."""

    flight: str
    start_gps_s: float  # GPS time of ``t_s = 0``, s since 1980-01-06
    origin: Origin  # of the frame ``n``
    estimate: Estimate


def _plain(value: object) -> str | float:
    """Return a message as its text, a number of NumPy's as one of Python's."""
    return str(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type]


def save_estimate(estimate: Estimate, flight: Flight, path: Path | str) -> None:
    """Write an estimate's arrays, frame and clock; integers, unused and notes are in summary.json.

    Parameters
    ----------
    estimate : Estimate
    flight : Flight
        What was estimated: its name, clock and origin go with the arrays.
    path : Path or str
        Of a file that ends in ``.npz``.

    Raises
    ------
    BadInputError
        If the file cannot be written.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Smoother(noise="nominal")(flight)
    >>> fgnav.save_estimate(estimate, flight, "saved.npz")
    >>> bool((fgnav.load_estimate("saved.npz").estimate.R_nb == estimate.R_nb).all())
    True
    """
    head = _Head(
        format=_FORMAT,
        flight=flight.name,
        start_gps_s=flight.start_gps_s,
        origin=flight.origin,
        **{name: getattr(estimate, name) for name in _OF_ESTIMATE},
    )
    values = {field.name: getattr(estimate, field.name) for field in fields(estimate)}
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    content: dict[str, Any] = {
        "head": np.array(msgspec.json.encode(head, enc_hook=_plain).decode()),
        **arrays,
    }
    with atomic_file(Path(path)) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **content)


def load_estimate(path: Path | str) -> RecordedEstimate:
    """Read the estimate that ``save_estimate`` or ``fgnav run`` has left in a file or a folder.

    Parameters
    ----------
    path : Path or str

    Returns
    -------
    RecordedEstimate
        ``estimate``, and the flight's name, clock and origin.

    Raises
    ------
    BadInputError
        If there is none, or the file is something else.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> fgnav.save_estimate(fgnav.Smoother(noise="nominal")(flight), flight, "kept.npz")
    >>> recorded = fgnav.load_estimate("kept.npz")
    >>> recorded.flight, recorded.estimate.method
    ('demo', 'smoother')
    """
    file = Path(path)
    file = file / FILE if file.is_dir() else file
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        head = msgspec.json.decode(str(arrays.pop("head")), type=_Head)
        if head.format != _FORMAT:
            raise BadInputError(f"{file}: must be {_FORMAT!r}, got {head.format!r}")
        own = {name: getattr(head, name) for name in _OF_ESTIMATE}
        return RecordedEstimate(
            flight=head.flight,
            start_gps_s=head.start_gps_s,
            origin=head.origin,
            estimate=Estimate(**own, **arrays),
        )
    except FileNotFoundError:
        raise BadInputError(f"{file}: no such estimate; fgnav run FLIGHT --out writes it") from None
    except (BadZipFile, EOFError, KeyError, TypeError, ValueError, msgspec.MsgspecError) as error:
        if isinstance(error, BadInputError):
            raise
        raise BadInputError(f"{file}: must be an estimate.npz of fgnav run, {error}") from error

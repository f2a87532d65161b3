"""An estimate on disk without loss: arrays as they are, in an npz file that holds no objects."""

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.io.atomic_write import atomic_file
from fgnav.types.estimate import Estimate, Verdict
from fgnav.types.flight import Flight

FILE = "estimate.npz"
_FORMAT = "fgnav estimate 1"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RecordedEstimate:
    """An estimate with what fixes its frame and its clock."""

    flight: str
    start_gps_s: float  # GPS time of ``t_s = 0``, s since 1980-01-06
    origin: Origin  # of the frame ``n``
    estimate: Estimate


def save_estimate(estimate: Estimate, flight: Flight, path: Path | str) -> None:
    """Write an estimate's arrays, frame and clock; integers, losses and notes are in summary.json.

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
    >>> estimate = fgnav.Smoother(noise="stated")(flight)
    >>> fgnav.save_estimate(estimate, flight, "saved.npz")
    >>> bool((fgnav.load_estimate("saved.npz").estimate.R_nb == estimate.R_nb).all())
    True
    """
    head = {
        "format": _FORMAT,
        "flight": flight.name,
        "method": estimate.method,
        "epochs": estimate.epochs,
        "converged": estimate.converged,
        "unobservable": estimate.unobservable,
        "notes": estimate.notes,
        "verdicts": [asdict(one) for one in estimate.verdicts],
        "start_gps_s": flight.start_gps_s,
        "latitude_rad": flight.origin.latitude_rad,
        "longitude_rad": flight.origin.longitude_rad,
        "height_m": flight.origin.height_m,
    }
    content: dict[str, Any] = {"head": np.array(json.dumps(head)), **_arrays(estimate)}
    with atomic_file(Path(path)) as part, part.open("wb") as file:
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
    >>> fgnav.save_estimate(fgnav.Smoother(noise="stated")(flight), flight, "kept.npz")
    >>> recorded = fgnav.load_estimate("kept.npz")
    >>> recorded.flight, recorded.estimate.method
    ('demo', 'smoother')
    """
    file = Path(path)
    file = file / FILE if file.is_dir() else file
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
        head: dict[str, Any] = json.loads(str(arrays.pop("head")))
        if head["format"] != _FORMAT:
            raise BadInputError(f"{file}: must be {_FORMAT!r}, got {head['format']!r}")
        return _recorded(head, arrays)
    except FileNotFoundError:
        raise BadInputError(f"{file}: no such estimate; fgnav run FLIGHT --out writes it") from None
    except (BadZipFile, EOFError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, BadInputError):
            raise
        raise BadInputError(f"{file}: must be an estimate.npz of fgnav run, {error}") from error


def _recorded(head: dict[str, Any], arrays: dict[str, Any]) -> RecordedEstimate:
    estimate = Estimate(
        method=head["method"],
        epochs=head["epochs"],
        converged=head["converged"],
        unobservable=tuple(head["unobservable"]),
        notes=tuple(head["notes"]),
        verdicts=tuple(Verdict(**one) for one in head.get("verdicts", ())),
        **arrays,
    )
    place = {name: head[name] for name in ("latitude_rad", "longitude_rad", "height_m")}
    return RecordedEstimate(
        flight=head["flight"],
        start_gps_s=head["start_gps_s"],
        origin=Origin(**place),
        estimate=estimate,
    )


def _arrays(estimate: Estimate) -> dict[str, FloatArray]:
    """Return the fields that hold arrays."""
    values = {field.name: getattr(estimate, field.name) for field in fields(estimate)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}

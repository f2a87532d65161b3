"""Files of a campaign: its order, and one of each run, whole or not there."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from fgnav.campaign.order import Order, Run, runs_of
from fgnav.checks import BadInputError
from fgnav.io.atomic_write import made_folder, write_text

_ORDER = "campaign.json"
_RUNS = "runs"


class Folder:
    """The folder of a campaign.

    Parameters
    ----------
    path : Path
        Made if absent.
    resume : bool
        Whether runs that are there already are kept.

    Raises
    ------
    BadInputError
        If it holds anything and is not to be resumed, or holds another campaign.
    """

    def __init__(self, path: Path, order: Order, *, resume: bool) -> None:
        if path.exists() and not path.is_dir():
            raise BadInputError(f"--out: {path} is a file; name a folder")
        filled = path.is_dir() and any(path.iterdir())
        if filled and not resume:
            raise BadInputError(
                f"--out: {path} holds files; go on with --resume, or take a new folder"
            )
        if filled:
            _check_same(path / _ORDER, order)
        self.path, self._order = path, order
        self._runs = made_folder(path / _RUNS)
        for unfinished in self._runs.glob(".*.part"):  # of a run that was killed while writing
            unfinished.unlink(missing_ok=True)
        write_text(
            path / _ORDER,
            msgspec.json.format(
                msgspec.json.encode({"digest": order.digest, "order": order}), indent=2
            ).decode()
            + "\n",
        )

    def missing(self) -> list[Run]:
        """Return the runs of the order that have no file."""
        present = {path.stem for path in self._runs.glob("*.json")}
        return [run for run in runs_of(self._order) if run.stem not in present]

    def keep(self, run: Run, record: dict[str, Any]) -> None:
        """Write a run's file.

        Raises
        ------
        BadInputError
            If it cannot be written: no room, for one.
        """
        text = msgspec.json.encode(record, enc_hook=str).decode() + "\n"
        # Leftovers went when the folder was opened: to look for them again lists all runs so far.
        write_text(self._runs / f"{run.stem}.json", text, tidy=False)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the records of the order's runs that are there, by case, column and flight.

        Raises
        ------
        BadInputError
            If a file is damaged, by name.
        """
        for run in sorted(runs_of(self._order)):
            path = self._runs / f"{run.stem}.json"
            if not path.is_file():
                continue
            try:
                record: dict[str, Any] = msgspec.json.decode(path.read_bytes())
            except msgspec.DecodeError as error:
                raise BadInputError(f"{path}: {error}; delete it and --resume") from None
            yield record


def _check_same(path: Path, order: Order) -> None:
    """Raise unless a folder's campaign is this one, but for the number of flights."""
    try:
        before = msgspec.json.decode(path.read_bytes())
        digest = before["digest"]
    except (OSError, msgspec.DecodeError, KeyError, TypeError):
        raise BadInputError(f"--out: {path.parent} is not a campaign's folder; name it") from None
    if digest != order.digest:
        raise BadInputError(
            f"--out: {path.parent} holds another campaign ({digest[:12]}, this is "
            f"{order.digest[:12]}); take a new folder"
        )

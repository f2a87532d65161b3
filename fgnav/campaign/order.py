"""Format of a campaign file, and its flights, each with a seed of its own."""

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from fgnav.checks import BadInputError
from fgnav.io.strict_toml import Table, as_table, read_toml

_Name = Annotated[str, msgspec.Meta(pattern=r"^[^/\\\x00-\x1f]{1,80}$")]
_DAY_S = 86_400
_Flights = Annotated[int, msgspec.Meta(ge=1, le=10_000_000)]


class MethodTable(Table, frozen=True):
    """A method with its settings, by the names of the command line."""

    method: str
    name: _Name | None = None  # what tables call it; the method's own name where none is given
    integers: str = "constrained"  # who resolves integers
    gravity: str | None = None
    # calibrate, factors, without: ``without`` names what is left out of the flight first, see
    # ``evaluation.ablation``
    calibrate: tuple[str, ...] = ()
    factors: tuple[str, ...] | None = None  # none: the networks of a flight by default
    without: tuple[str, ...] = ()
    causal: bool = False
    lag_s: Annotated[float, msgspec.Meta(gt=0)] | None = None

    @property
    def title(self) -> str:
        """Name in tables."""
        return self.name or self.method


class SweepTable(Table, frozen=True):
    """Keys of a scenario that take a list of values, one after another."""

    name: _Name  # what tables call it: ``"amplitude_deg"``
    values: Annotated[tuple[float, ...], msgspec.Meta(min_length=1)]  # headings of the columns
    # by dotted key, the value for each column; a key without a list takes ``values``
    keys: dict[str, tuple[Any, ...] | bool]

    def __post_init__(self) -> None:
        """Require one value of each key for each column."""
        if not self.keys:
            raise ValueError("keys: names none")
        for key, values in self.keys.items():
            if values is False or (values is not True and len(values) != len(self.values)):
                raise ValueError(f"keys.{key}: wants true or {len(self.values)} values")

    def changes(self, column: int) -> dict[str, Any]:
        """Return the values of a column by dotted key."""
        own = {k: self.values if v is True else v for k, v in self.keys.items()}
        return {key: values[column] for key, values in own.items() if not isinstance(values, bool)}


class CaseTable(Table, frozen=True):
    """A kind of flight."""

    name: _Name
    scenario: str  # of the simulator: a name it knows, or a file beside the campaign's
    # by dotted key, what the scenario says instead
    changes: dict[str, Any] = msgspec.field(default_factory=dict)
    sweep: SweepTable | None = None
    # whether each flight starts at a time of the day of its own, so under a sky of its own
    any_hour: bool = False
    condition: str = ""  # cases of one condition share a table

    @property
    def title(self) -> str:
        """Name in tables."""
        return f"{self.name}, {self.condition}" if self.condition else self.name

    @property
    def columns(self) -> int:
        """Values of the sweep; 1 without one."""
        return 1 if self.sweep is None else len(self.sweep.values)

    def changed(self, column: int) -> dict[str, Any]:
        """Return all that a column changes of the scenario, by dotted key."""
        swept = {} if self.sweep is None else self.sweep.changes(column)
        return {**self.changes, **swept}


class Order(Table, frozen=True):
    """A campaign: every case, so many flights each, through every method."""

    seed: Annotated[int, msgspec.Meta(ge=0)]  # root of all random numbers
    flights: _Flights  # of each case and value of its sweep
    method: Annotated[tuple[MethodTable, ...], msgspec.Meta(min_length=1)]
    case: Annotated[tuple[CaseTable, ...], msgspec.Meta(min_length=1)]
    # by name, what a condition changes of every case, by dotted key; cases have the same random
    # draws under each
    condition: dict[_Name, dict[str, Any]] = msgspec.field(default_factory=dict)
    name: str = ""
    # the method that others are held against; the first where none is named
    baseline: str | None = None

    def __post_init__(self) -> None:
        """Require names that differ, and a baseline among them."""
        for kind, names in (("method", self.titles), ("case", [c.title for c in self.case])):
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{kind}: two are named {name!r}; give each its own name")
        if self.baseline is not None and self.baseline not in self.titles:
            raise ValueError(f"baseline: must be one of {', '.join(self.titles)}")

    @property
    def titles(self) -> list[str]:
        """Names of the methods in tables, in order."""
        return [method.title for method in self.method]

    @property
    def reference(self) -> str:
        """The method that others are held against."""
        return self.baseline or self.titles[0]

    @property
    def count(self) -> int:
        """Number of flights of all cases and values."""
        return self.flights * sum(case.columns for case in self.case)

    @property
    def digest(self) -> str:
        """Sha256 of all that decides a run's figures but the number of flights."""
        content: Mapping[str, Any] = msgspec.to_builtins(self)
        decisive = {key: value for key, value in content.items() if key not in ("flights", "name")}
        return sha256(msgspec.json.encode(decisive, order="sorted")).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Run:
    """One flight of a campaign."""

    # case, column, flight: places in the order; flights are numbered from 0 within case and column
    case: int
    column: int
    flight: int

    @property
    def stem(self) -> str:
        """Name of its file."""
        return f"{self.case:03d}-{self.column:03d}-{self.flight:07d}"


def runs_of(order: Order) -> Iterator[Run]:
    """Yield all flights, a flight of every case and column before the next flight of any.

    A campaign that is cut short then has some of everything.
    """
    for flight in range(order.flights):
        for case, table in enumerate(order.case):
            for column in range(table.columns):
                yield Run(case=case, column=column, flight=flight)


def seed_of(order: Order, run: Run) -> np.random.SeedSequence:
    """Return the seed of a run's random numbers.

    Named by the case's name, the flight's number and the root alone: columns of a sweep share
    their draws, so that they differ by what is swept, and so do conditions; cases added later
    change no other.
    """
    case = zlib.crc32(order.case[run.case].name.encode())
    return np.random.SeedSequence(order.seed, spawn_key=(case, run.flight))


def start_shift_s(case: CaseTable, seed: np.random.SeedSequence) -> int:
    """Return by how many seconds a flight starts later than its scenario says."""
    if not case.any_hour:
        return 0
    return int(np.random.default_rng(seed.spawn(1)[0]).integers(_DAY_S))


def load_order(path: Path, *, flights: int | None = None) -> Order:
    """Return the campaign in a TOML file, with a case for each case and condition.

    Scenarios that are files are named from its folder.

    Parameters
    ----------
    flights : int, optional
        Of each case and value of its sweep; as the file has it by default.

    Raises
    ------
    BadInputError
        One line that names file, key, rule and value.
    """
    if not path.is_file():
        raise BadInputError(f"{path}: no such campaign file")
    if flights is not None and flights < 1:
        raise BadInputError(f"--flights: must be 1 or more, got {flights}")
    order = as_table(path, read_toml(path), Order)
    cases = tuple(
        msgspec.structs.replace(
            case,
            scenario=_beside(path, case.scenario),
            condition=condition or case.condition,
            changes={**case.changes, **changes},
        )
        for condition, changes in (order.condition or {"": {}}).items()
        for case in order.case
    )
    return msgspec.structs.replace(
        order,
        name=order.name or path.stem,
        flights=flights or order.flights,
        case=cases,
        condition={},
    )


def _beside(path: Path, scenario: str) -> str:
    return str((path.parent / scenario).resolve()) if scenario.endswith(".toml") else scenario

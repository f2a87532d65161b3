"""The flights of a campaign, each with a seed of its own that nothing else decides."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fgnav.campaign.order import CaseTable, Order

_DAY_S = 86_400


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
    """Return what a run's random numbers grow from.

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

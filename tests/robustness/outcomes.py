"""What becomes of a damaged flight: judged from outside, as a user sees it."""

import contextlib
import io
import re
import resource
import shutil
import signal
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np

from fgnav import cli
from fgnav.io.flight import folder as flight_folder
from fgnav.types.flight import Flight
from tests.robustness.damages import FAMILIES, SHARES

METHODS = ("closed-form", "smoother", "smoother")
CPU_S, MEMORY_BYTES = 15.0, 2 << 30
WRONG_NEES = 30.0  # of 3: beyond any chance, 1e-6 of one right epoch
# A case is good if the answer is that of the whole flight or near it, if a new sentence is printed,
# if the flight is refused in one line that has its place, or has no solution, again in one line.
GOOD = ("same", "said", "refused", "no solution")
BAD = ("silent loss", "silent and wrong", "traceback", "hang", "memory", "unnamed", "warning")


@dataclass(frozen=True)
class Outcome:
    """One case: how it was made and what became of it."""

    seed: int
    damage: str
    command: str
    kind: str
    text: str


class Hang(BaseException):
    """A case took too long; not an Exception, so that nothing on the way swallows it."""


@dataclass(frozen=True)
class Whole:
    """An undamaged flight: its counts, and what each method says of it."""

    folder: Path
    counts: dict[str, int]
    truth: Flight
    said: dict[str, str]


def undamaged(folder: Path, scratch: Path) -> Whole:
    """Run each method on a right flight."""
    flight = flight_folder.load_flight(folder)
    said = {}
    for method in set(METHODS):
        status, out, err = called(["run", str(folder), "--method", method, "--out", str(scratch)])
        assert status == 0, err
        said[method] = remarks_of(out + err)
    return Whole(folder=folder, counts=counts(flight), truth=flight, said=said)


def case(whole: Whole, seed: int, scratch: Path) -> Outcome:
    """Damage a copy of a flight and run a method on it."""
    rng = np.random.default_rng([77, seed])
    family = rng.choice(list(SHARES), p=list(SHARES.values()))
    method = METHODS[int(rng.integers(len(METHODS)))]
    folder, out = scratch / "flight", scratch / "out"
    for place in (folder, out):
        shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(whole.folder, folder)
    damage = f"{whole.folder.name}, {FAMILIES[family](folder, rng)}"
    command = ["run", str(folder), "--method", method, "--out", str(out)]
    kind, text = _judged(whole, command, method, out)
    if kind == "silent loss" and family == "set-up":  # whoever takes a table out wants it so
        kind = "same"
    return Outcome(seed, damage, method, kind, text)


def _judged(whole: Whole, command: list[str], method: str, out: Path) -> tuple[str, str]:
    seen: list[Flight] = []

    def load(path):
        seen.append(flight_folder_load(path))
        return seen[-1]

    flight_folder_load = flight_folder.load_flight
    try:
        with limits(), mock.patch.object(flight_folder, "load_flight", load):
            status, printed, err = called(command)
    except Hang:
        return "hang", ""
    except MemoryError:
        return "memory", traceback.format_exc(limit=-3)
    except Exception:  # noqa: BLE001  # what is looked for
        return "traceback", traceback.format_exc(limit=-3)
    if "Warning:" in err:
        return "warning", err.strip()
    if status in (1, 2):
        bad = misshapen(err, status)
        return (bad or ("refused" if status == 2 else "no solution")), err.strip()
    if status != 0:
        return "traceback", f"status {status}: {err}"
    more = remarks_of(printed + err) != whole.said[method]
    if not more and counts(seen[0]) != whole.counts:
        lost = {k: v for k, v in counts(seen[0]).items() if v != whole.counts[k]}
        return "silent loss", f"{lost} of {whole.counts}"
    nees = attitude_nees(out / "estimate.csv", whole.truth)
    if nees > WRONG_NEES and not more:
        return "silent and wrong", f"NEES {nees:.0f}"
    return ("said" if more else "same"), f"NEES {nees:.1f}"


def misshapen(err: str, status: int) -> str:
    """Return what is wrong with an error's text; nothing where it is one line of decent length.

    Findings about set-up come before it.
    """
    lines = [line for line in err.strip().splitlines() if not line.startswith("check: ")]
    if len(lines) != 1 or not lines[0].startswith("fgnav: ") or not lines[0].isprintable():
        return "unnamed"
    if len(lines[0]) > 700:
        return "unnamed"
    # Bad input has a place: a file of the flight, or the flight by name.
    is_named = status == 1 or re.search(r"/flight|flight |fgnav: [a-z]+: \w+( \w+)+: ", lines[0])
    return "" if is_named else "unnamed"


def called(arguments: list[str]) -> tuple[int, str, str]:
    """Return status, output and errors of the command line, called in this process."""
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("default")
        status = cli.main(arguments)
    return status, out.getvalue(), err.getvalue()


def remarks_of(printed: str) -> str:
    """Return what is printed beside figures: every kind of sentence, without its numbers."""
    lines = printed.splitlines()[1:]
    return "\n".join(sorted(re.sub(r"[-+]?\d[\d.e+-]*", "#", line) for line in lines))


def counts(flight: Flight) -> dict[str, int]:
    """Return how much of everything a flight holds."""
    held = {name: len(series.t_s) for name, series in flight.records.items()}
    if flight.photodetector is not None:
        held["calibration"] = len(flight.photodetector.calibration)
    if flight.truth is not None and flight.truth.integers is not None:
        held["integers"] = len(flight.truth.integers.cycles)
    if flight.observations is not None:
        held["epochs"] = len(flight.observations.t_s)
        for name in ("code_m", "phase_cycles", "doppler_hz"):
            held[name] = int(np.isfinite(getattr(flight.observations, name)).sum())
    if flight.broadcast is not None:
        held["messages"] = len(flight.broadcast.records)
    if flight.precise is not None:
        held["orbits"] = int(np.isfinite(flight.precise.p_e_m).sum())
    return held


def attitude_nees(path: Path, flight: Flight) -> float:
    """Return the mean normalised error squared of the three angles, axis by axis, of 3."""
    from fgnav.io.flight.local_frame import attitude_of_n

    table = np.genfromtxt(path, delimiter=",", names=True)
    if "sigma_yaw_deg" not in table.dtype.names or not table.size:
        return 0.0
    table = np.atleast_1d(table)
    truth = flight.truth
    angles = np.unwrap(attitude_of_n(flight.origin, truth.p_n_m, truth.R_nb), axis=0, period=360.0)
    total = np.zeros(len(table))
    for k, name in enumerate(("roll", "pitch", "yaw")):
        real = np.interp(table["t_s"], truth.t_s, angles[:, k])
        off = (table[f"{name}_deg"] - real + 180.0) % 360.0 - 180.0
        total += (off / np.maximum(table[f"sigma_{name}_deg"], 1e-9)) ** 2
    inside = (table["t_s"] >= truth.t_s[0]) & (table["t_s"] <= truth.t_s[-1])
    return float(np.nanmean(total[inside])) if inside.any() else 0.0


@contextlib.contextmanager
def limits() -> Iterator[None]:
    """Bound CPU time and memory of what runs inside; pytest's own timeout has the other timer."""

    def stop(_number, _frame):
        raise Hang

    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGPROF, stop)
    resource.setrlimit(
        resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY_BYTES, before[1])
    )
    signal.setitimer(signal.ITIMER_PROF, CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)
        signal.signal(signal.SIGPROF, handler)

"""What wrong integers, jumping fixes and outages cost: against the same flights without them.

``ROBUSTNESS_FLIGHTS`` in the environment states how many (50), ``ROBUSTNESS_SEED`` their first seed
(20000: none that has chosen a constant of the library).
"""

import os
import re
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Batch, Forward
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers
from fgnav_sim.gnss.tables import OutageTable, SlipsTable
from fgnav_sim.scenario import Place, load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks.allowed import allowed_peaks
from tests.methods.simulated import SCENARIOS, errors_rad

FLIGHTS = int(os.environ.get("ROBUSTNESS_FLIGHTS", "50"))
SEED = int(os.environ.get("ROBUSTNESS_SEED", "20000"))
SHARES = {0.01: 1.03, 0.05: 1.05, 0.10: 1.10, 0.20: 2.0}
LENGTHS_S = (5.0, 15.0, 30.0, 60.0)
FROM_S, SWING_S = (
    15.0,
    2 * np.pi,
)  # an outage begins, in one flight here, in another there in a swing
EPOCH_S = 0.11  # and a little
BOTH = ("attitude", "position")
# What an outage takes away: without one antenna, or the detector, positions go on.
KINDS = {
    "all_gnss": BOTH,
    "all_gnss_gyro": BOTH,
    "antenna": BOTH[:1],
    "reference": BOTH[:1],
    "seeker": BOTH[:1],
}
WITHIN, PEAK = 0.99, 0.35
DRAWS = 50
# What the estimate says is missing.
LISTED = {
    "all_gnss": "position",
    "all_gnss_gyro": "position",
    "antenna": "phase of antenna a3",
    "reference": "observations of the reference antenna a1",
    "seeker": "line of sight",
}
NAMES = (
    *(f"wrong_arcs_{round(100 * share)}_percent" for share in SHARES),
    "wrong_arcs_10_percent_worst",
    *(f"outage_{kind}_{length_s:.0f}_s_within" for kind in KINDS for length_s in LENGTHS_S),
    *(f"outage_{kind}_peak_{what}" for kind, lost in KINDS.items() for what in lost),
    *(f"outage_all_gnss_gyro_allowed_{what}" for what in BOTH),
    *(f"outage_{kind}_listed" for kind in KINDS),
)
SLIPS_PER_HOUR = 120.0  # of a link: with those of the reference, arcs of some ten seconds
# A beacon that the detector sees from the first second on, eleven kilometres down the path.
BEACON = Place(latitude_deg=40.43, longitude_deg=-3.88, height_m=170.0)
FAR = {"range_m": 12_000.0, "landmark": BEACON}
MORE = {"all_gnss_gyro": 5}  # times as many flights: their peaks are noise and differ by a third
GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 2e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}


def run(flights: int = FLIGHTS) -> list[dict]:
    """Return the rows."""
    return [*_wrong_arcs(flights), *_outages(max(2, flights // 8))]


@dataclass(frozen=True)
class WrongArcs:
    """True integers, a share of arcs off by one to three cycles as a whole."""

    share: float
    seed: int
    name: str = "wrong-arcs"
    looks_ahead = False  # as the truth; asked epoch by epoch it would draw anew at each

    def __call__(self, differences, flight):
        """Resolve."""
        true, rng = Truth()(differences, flight), np.random.default_rng(self.seed)
        shape = (*differences.arc.shape[1:], differences.arc.max() + 1)
        size = rng.integers(1, 4, shape) * rng.choice((-1, 1), shape)
        size *= rng.random(shape) < self.share
        arc = differences.arc.clip(0).transpose(1, 2, 0)
        off = np.take_along_axis(size, arc, axis=2).transpose(2, 0, 1)
        cycles = np.where(true.fixed, true.cycles + off, 0)
        return Integers(resolver=self.name, cycles=cycles, fixed=true.fixed, ratio=true.ratio)


def _wrong_arcs(flights: int) -> list[dict]:
    """Every other flight has slips; in the others arcs last the whole flight."""
    growth = {share: [] for share in SHARES}
    for seed in range(SEED, SEED + flights):
        slips = SlipsTable(rate_per_hour=SLIPS_PER_HOUR, flagged_share=0.7) if seed % 2 else None
        flight = _flown(seed, 20.0 + 5.0 * (seed % 5), gnss={"slips": slips})
        clean_rad = _rms(errors_rad(flight, Batch(resolver=Truth())(flight)))
        for share in SHARES:
            estimate = Batch(resolver=WrongArcs(share, seed))(flight)
            growth[share].append(_rms(errors_rad(flight, estimate)) / clean_rad)
    note = f"attitude RMSE over that with right integers; {flights} flights of 20 to 40 s"
    rows = [
        _row(f"wrong_arcs_{round(100 * share)}_percent", np.median(growth[share]), most, note)
        for share, most in SHARES.items()
    ]
    worst = max(growth[0.10])
    return [*rows, _row("wrong_arcs_10_percent_worst", worst, 2.0, f"the worst flight: {note}")]


def _outages(few: int) -> list[dict]:
    """In each flight an outage begins at another phase of the body's swing."""
    rows = []
    for kind, affected in KINDS.items():
        flights = few * MORE.get(kind, 1)
        ratios, lost, listed, allowed = [], 0, [], []
        for length_s in LENGTHS_S:
            outages = [
                (FROM_S + k / flights * SWING_S, FROM_S + k / flights * SWING_S + length_s)
                for k in range(flights)
            ]
            flown = [_with_outage(kind, outage_s, SEED + k) for k, outage_s in enumerate(outages)]
            judged = [_judged(*pair) for pair in zip(flown, outages, strict=True)]
            rows.append(_share_row(kind, length_s, [one.within for one in judged]))
            listed += [
                _is_listed(kind, outage_s, one.notes)
                for outage_s, one in zip(outages, judged, strict=True)
            ]
            both = [one for one in judged if one.forward is not None]
            lost += len(judged) - len(both)
            if both:
                ratios.append(sum(one.smoothed for one in both) / sum(one.forward for one in both))
            if kind == "all_gnss_gyro":
                allowed.append(_allowed(flown[0], outages[0]))
        note = f"largest errors in outages, batch over forward; {flights} flights, {lost} lost"
        rows += _peak_rows(f"outage_{kind}_peak", affected, ratios, f"{note} by forward")
        if allowed:
            note = "what peaks are to be with errors drawn from the model that both have"
            rows += _peak_rows(f"outage_{kind}_allowed", affected, allowed, note)
        rows.append(_listed_row(kind, listed))
    return rows


def _peak_rows(
    name: str, affected: tuple[str, ...], ratios: list[FloatArray], note: str
) -> list[dict]:
    """Return a row for each of attitude and position, its worst length of outages."""
    rows = []
    for what, of in zip(affected, np.transpose(ratios), strict=False):
        each = ", ".join(f"{ratio:.2f}" for ratio in of)
        rows.append(_row(f"{name}_{what}", of.max(), PEAK, f"{note}; each length: {each}"))
    return rows


def _allowed(flight: Flight, outage_s: tuple[float, float]) -> FloatArray:
    """Return the smoother's mean peaks over the filter's, drawn from the model, (2,)."""
    problem = Batch(resolver=Truth()).prepare(flight).problem
    during = _during(problem.t_s, outage_s)
    smoothed, forward = allowed_peaks(problem, during, DRAWS, np.random.default_rng(0))
    return np.asarray(smoothed / forward)


def _is_listed(kind: str, outage_s: tuple[float, float], notes: tuple[str, ...]) -> bool:
    """Return whether the notes have a gap of the outage's own times, but for an epoch."""
    for note in notes:
        found = re.search(rf"No {LISTED[kind]} from ([\d.]+) to ([\d.]+) s", note)
        times_s = np.array(found.groups(), dtype=float) if found else np.full(2, np.inf)
        if (np.abs(times_s - outage_s) < EPOCH_S).all():
            return True
    return False


def _listed_row(kind: str, listed: list[bool]) -> dict:
    share = float(np.mean(listed))
    note = f"outages that the estimate lists with their times; {len(listed)}"
    name = f"outage_{kind}_listed"
    return {"name": name, "ours": share, "peer": 1.0, "ratio": share, "unit": "share", "note": note}


def _share_row(kind: str, length_s: float, within: list[float]) -> dict:
    share = float(np.mean(within))
    return {
        "name": f"outage_{kind}_{length_s:.0f}_s_within",
        "ours": share,
        "peer": WITHIN,
        "ratio": share / WITHIN,
        "unit": "share of epochs",
        "note": f"each axis of attitude and position, batch, within three sigmas (normal: 0.997); "
        f"{len(within)} flights",
    }


def _with_outage(kind: str, outage_s: tuple[float, float], seed: int) -> Flight:
    """Return a flight in which something is missing for a while."""
    span_s = outage_s[1] + 15.0
    if kind == "seeker":
        return _blinded(_flown(seed, span_s, "terminal", seeker=FAR), outage_s)
    antennas = {"antenna": ("a3",), "reference": ("a1",)}.get(kind, ())
    outage = OutageTable(from_s=outage_s[0], until_s=outage_s[1], antennas=antennas)
    imu = GYROSCOPE if kind == "all_gnss_gyro" else {}
    return _flown(seed, span_s, gnss={"outages": (outage,)}, imu=imu)


def _blinded(flight: Flight, outage_s: tuple[float, float]) -> Flight:
    """Return a flight without what its detector saw in the outage."""
    seeker = flight.seeker
    seen = (seeker.t_s < outage_s[0]) | (seeker.t_s >= outage_s[1])
    rest = replace(seeker, t_s=seeker.t_s[seen], currents=seeker.currents[seen])
    return replace(flight, seeker=rest)


@dataclass(frozen=True)
class _Judged:
    """Share of errors within three sigmas; largest errors, attitude and position, (2,) each."""

    within: float
    notes: tuple[str, ...]
    smoothed: FloatArray
    forward: FloatArray | None  # None: it has no solution


def _judged(flight: Flight, outage_s: tuple[float, float]) -> _Judged:
    smoothed = Batch(resolver=Truth())(flight)
    try:
        forward = _peaks(flight, Forward(resolver=Truth())(flight), outage_s)
    except NoSolutionError:
        forward = None
    return _Judged(
        within=_within(flight, smoothed),
        notes=smoothed.notes,
        smoothed=_peaks(flight, smoothed, outage_s),
        forward=forward,
    )


def _peaks(flight, estimate, outage_s: tuple[float, float]) -> FloatArray:
    during = _during(estimate.t_s, outage_s)
    errors = errors_rad(flight, estimate), _off_m(flight, estimate)
    return np.array([np.linalg.norm(error[during], axis=1).max() for error in errors])


def _during(t_s: FloatArray, outage_s: tuple[float, float]) -> BoolArray:
    return (t_s >= outage_s[0]) & (t_s <= outage_s[1])


def _within(flight, estimate) -> float:
    """Return the share of errors within three sigmas, axis by axis, all epochs of the flight."""
    sigma = np.sqrt(np.einsum("nii->ni", estimate.attitude_covariance_rad2))
    attitude = np.abs(errors_rad(flight, estimate)) < 3 * sigma
    sigma = np.sqrt(np.einsum("nii->ni", estimate.position_covariance_m2))
    return float(np.mean([attitude, np.abs(_off_m(flight, estimate)) < 3 * sigma]))


def _row(name: str, ours: float, most: float, note: str) -> dict:
    """Return a row whose ours should stay below a bound, its peer."""
    return {
        "name": name,
        "ours": float(ours),
        "peer": most,
        "ratio": most / float(ours),
        "unit": "x",
        "note": note,
    }


def _flown(seed: int, span_s: float, name: str = "demo", **tables: dict) -> Flight:
    """Return a flight of a scenario with some entries of its tables replaced."""
    scenario, change = load_scenario(SCENARIOS / f"{name}.toml"), msgspec.structs.replace
    changed = {table: change(getattr(scenario, table), **new) for table, new in tables.items()}
    scenario = change(scenario, duration_s=span_s, **changed)
    return simulate(scenario, np.random.default_rng(seed))


def _off_m(flight, estimate) -> FloatArray:
    truth = flight.truth
    place = [np.interp(estimate.t_s, truth.t_s, column) for column in truth.p_n_m.T]
    return estimate.p_n_m - np.stack(place, axis=1)


def _rms(error: FloatArray) -> float:
    return float(np.sqrt((error**2).sum(axis=1).mean()))

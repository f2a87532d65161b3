"""Simulated receivers judged: by RTKLIB, and by the slip detector that has to find their slips."""

import json
import tempfile
from pathlib import Path

import msgspec
import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.gnss.cycle_slips.detection import phase_arcs
from fgnav.gnss.single_differences import single_differences
from fgnav.io.flight.folder import save_flight
from fgnav.types.flight import Flight
from fgnav_sim.gnss.tables import GnssTable, SlipsTable
from fgnav_sim.scenario import Scenario, load_scenario
from fgnav_sim.simulate import simulate
from tests.gnss import rtklib
from tests.sim import moving_base

SCENARIO = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios" / "demo.toml"
SKY = {"G": ("1C",), "E": ("1C",), "C": ("2I",)}
RATES = ((1.0, 1200.0), (10.0, 120.0))
SLIPS = SlipsTable(rate_per_hour=10.0, largest_cycles=10, flagged_share=0.5)
NAMES = (
    "rtklib_fix_rate",
    "rtklib_baseline_error",
    "rtklib_point_error",
    *(
        f"slips_{what}_{rate_hz:g}hz"
        for rate_hz, _ in RATES
        for what in ("unflagged_found", "flagged_found", "false_alarms")
    ),
)


def run() -> list[dict]:
    """Return the rows."""
    scenario = load_scenario(SCENARIO)
    return [*_judged(scenario), *(row for rate in RATES for row in _slips(scenario, *rate))]


def _with(scenario: Scenario, duration_s: float, **gnss: object) -> Scenario:
    """Return the scenario with other settings of its receivers."""
    table = msgspec.structs.replace(scenario.gnss or GnssTable(), **gnss)
    return msgspec.structs.replace(scenario, duration_s=duration_s, gnss=table, imu=None)


def _judged(scenario: Scenario) -> list[dict]:
    flight = simulate(_with(scenario, 60.0, signals=SKY), np.random.default_rng(1))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "flight"
        save_flight(flight, folder)
        nav = rtklib.navigation(folder / "broadcast.rnx")
        t_s, p_e_m = rtklib.point_positions(folder / "a1.rnx", nav)
        point_m = flight.origin.to_n(p_e_m) - flight.truth.p_n_m[np.round(t_s * 10).astype(int)]
        solved = [(a, moving_base.baselines(folder, a.name)) for a in flight.antennas[1:]]
    fixed, error_m = [], []
    for antenna, (t_s, status, arm_e_m) in solved:
        truth_n_m = flight.truth.R_nb[np.round(t_s * 10).astype(int)] @ antenna.position_b_m
        fixed.append(status == moving_base.FIXED)
        error_m.append(np.linalg.norm(arm_e_m @ flight.origin.R_ne.T - truth_n_m, axis=1))
    fix, error = np.concatenate(fixed), np.concatenate(error_m)
    note = "demo's motion, G+E+C, one frequency, 7 baselines, RTKLIB moving base, continuous"
    return [
        _row("rtklib_fix_rate", 100 * fix.mean(), "%", note),
        _row(
            "rtklib_baseline_error",
            100 * np.sqrt(np.mean(error[fix] ** 2)),
            "cm",
            f"RMS, worst of {fix.sum()} {100 * error[fix].max():.1f} cm; phase noise 3 mm; {note}",
        ),
        _row(
            "rtklib_point_error",
            np.linalg.norm(point_m, axis=1).max(),
            "m",
            f"worst of {len(point_m)} single-point positions; code noise 0.3 m",
        ),
    ]


def _slips(scenario: Scenario, rate_hz: float, duration_s: float) -> list[dict]:
    """Return shares of slips found; a flight without slips, of the same seed, says where they are.

    Only links above the estimators' mask count: others are in no difference.
    """
    settings = {"signals": SKY, "rate_hz": rate_hz}
    calm, slipping = (
        simulate(_with(scenario, duration_s, slips=s, **settings), np.random.default_rng(1))
        for s in (None, SLIPS)
    )
    slipped, flagged, broken, on = _breaks(calm, slipping)
    quiet, loud = slipped & ~flagged, slipped & flagged
    false = broken & ~slipped & ~flagged
    note = f"{rate_hz:g} Hz, {on.sum() / len(on):.0f} links, slips of 1 to 10 cycles"
    return [
        _row(
            f"slips_{what}_{rate_hz:g}hz",
            100 * (broken & among).sum() / among.sum(),
            "%",
            f"of {among.sum()}; {note}",
        )
        for what, among in (("unflagged_found", quiet), ("flagged_found", loud))
    ] + [
        _row(
            f"slips_false_alarms_{rate_hz:g}hz",
            float(false.sum()),
            "count",
            f"in {on.sum()} steps of links; {note}",
        )
    ]


def _breaks(calm: Flight, slipping: Flight) -> tuple[BoolArray, BoolArray, BoolArray, BoolArray]:
    """Return where steps (n - 1, a, m) slip, are flagged, are found, and count."""
    single = single_differences(slipping)
    arc = phase_arcs(single, tuple(a.name for a in slipping.antennas)).arc
    seen = slipping.observations
    channels = list(zip(seen.satellites, seen.signals, strict=True))
    column = [channels.index(c) for c in zip(single.satellites, single.signals, strict=True)]
    change: FloatArray = (seen.phase_cycles - calm.observations.phase_cycles)[..., column]
    usable = np.isfinite(single.elevation_rad)
    on = (arc[1:] >= 0) & (arc[:-1] >= 0) & (usable[1:] & usable[:-1])[:, None]
    slipped = (np.diff(np.round(np.nan_to_num(change)), axis=0) != 0) & on
    flagged = (seen.lock_flags[1:][..., column] != 0) & on
    return slipped, flagged, (arc[1:] != arc[:-1]) & on, on


def _row(name: str, ours: float, unit: str, note: str) -> dict:
    return {
        "name": name,
        "ours": float(ours),
        "peer": None,
        "ratio": None,
        "unit": unit,
        "note": note,
    }


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))

"""Flights written by us, judged by RTKLIB's own program rnx2rtkp (Debian package rtklib)."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import msgspec
import numpy as np

from fgnav.checks import FloatArray
from fgnav.io.flight.folder import save_flight
from fgnav.types.flight import Flight
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.benchmarks._rows import Row, row

SKY = {"G": ("1C",), "E": ("1C",), "C": ("2I",)}
PROGRAM = "rnx2rtkp"
OPTIONS = ("-m", "10", "-sys", "G,E,C", "-f", "1", "-d", "6")
# The program corrects no atmosphere unless told; a file of settings resets the others.
SETTINGS = """\
pos1-ionoopt=brdc
pos1-tropopt=saas
pos2-armode=continuous
pos2-rejionno=30
out-timeform=tow
"""
FIXED = 1
WEEK_S = 604_800
VERSIONS = {"": "3.04", "_rinex4": "4.00"}
GATES = {
    "moving_base_fix_rate": ("share", ">= 0.95: epochs that are fixed, worst of 7 baselines"),
    "moving_base_error": ("m", "<= 0.02: RMS error where fixed, worst of 7 baselines"),
    "moving_base_largest": ("m", "largest error of a fixed epoch; noise at 10 deg is 17 mm a link"),
    "moving_base_point_error": ("m", "<= 3: largest error of a single-point position"),
}
NAMES = tuple(f"{name}{end}" for name in GATES for end in VERSIONS)


def run() -> list[Row]:
    """Return the rows, none where the program is not installed."""
    if shutil.which(PROGRAM) is None:
        print(f"{PROGRAM} is not installed")
        return []
    scenario = load_scenario("demo")
    gnss = msgspec.structs.replace(scenario.gnss or GnssTable(), signals=SKY)
    flight = simulate(msgspec.structs.replace(scenario, gnss=gnss), np.random.default_rng(1))
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for end, version in VERSIONS.items():
            folder = Path(name) / version
            save_flight(flight, folder, rinex=version)
            rows += [
                row(f"{gate}{end}", figure, None, unit, f"RINEX {version}; {note}")
                for (gate, (unit, note)), figure in zip(
                    GATES.items(), judged(flight, folder), strict=True
                )
            ]
    return rows


def judged(flight: Flight, folder: Path) -> tuple[float, float, float, float]:
    """Return the lowest fix rate, the worst RMS and the largest error, and that of a position."""
    rates, rms_m, largest_m = [], [], []
    for antenna in flight.antennas[1:]:
        files = (f"{antenna.name}.rnx", "a1.rnx", "broadcast.rnx")
        epoch, quality, enu_m = solved(flight, folder, files, "-p", "4", "-a")
        ned_m = enu_m[:, [1, 0, 2]] * (1, 1, -1)
        local = flight.origin.local_ned(flight.truth.p_n_m[epoch])
        truth_m = flight.truth.R_nb[epoch] @ antenna.position_b_m
        error_m = np.linalg.norm(np.einsum("nij,nj->ni", local, ned_m) - truth_m, axis=1)
        rates.append((quality == FIXED).sum() / len(flight.observations.t_s))
        rms_m.append(float(np.sqrt(np.mean(error_m[quality == FIXED] ** 2))))
        largest_m.append(error_m[quality == FIXED].max())
    epoch, _, p_e_m = solved(flight, folder, ("a1.rnx", "broadcast.rnx"), "-p", "0", "-e")
    point_m = np.linalg.norm(flight.origin.to_n(p_e_m) - flight.truth.p_n_m[epoch], axis=1)
    return min(rates), max(rms_m), max(largest_m), float(point_m.max())


def solved(
    flight: Flight, folder: Path, files: tuple[str, ...], *options: str
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return samples of the truth, quality and three coordinates of each epoch solved."""
    out = folder / "solution.pos"
    paths = [str(folder / name) for name in files]
    settings = folder / "rtklib.conf"
    settings.write_text(SETTINGS)
    command = [PROGRAM, "-k", str(settings), *options, *OPTIONS, "-o", str(out), *paths]
    subprocess.run(command, capture_output=True, check=True)
    table = np.loadtxt(out, comments="%", usecols=range(6), ndmin=2)
    t_s = table[:, 0] * WEEK_S + table[:, 1] - flight.start_gps_s
    step_s = flight.truth.t_s[1] - flight.truth.t_s[0]
    return np.round(t_s / step_s).astype(int), table[:, 5], table[:, 2:5]

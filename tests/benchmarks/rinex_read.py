"""Reading RINEX observations: ours, with checks, against RTKLIB's alone."""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from fgnav.io.rinex.reader import read_rinex
from fgnav.io.rinex.text import read_text
from fgnav.io.rinex.writer import write_observations
from fgnav.types.observations import Observations
from tests.benchmarks._rows import DATA, Row, row

START_GPS_S = 1_277_078_400.0
REPEATS = 5
NAMES = ("rinex_read", "rinex_read_short")
GRAS = DATA / "rinex" / "GRAS00FRA_R_20223151700_15M_01S_MO.crx.gz"
# RTKLIB's reader through the plain binding, in a process of its own: two pyrtklib in one crash.
PEER = """
import json, sys, time, pyrtklib5 as rtk
times = []
for _ in range(int(sys.argv[2])):
    obs, nav, station = rtk.obs_t(), rtk.nav_t(), rtk.sta_t()
    start = time.perf_counter()
    rtk.readrnx(sys.argv[1], 1, "", obs, nav, station)
    times.append(time.perf_counter() - start)
    rtk.freeobs(obs)
print(json.dumps(times))
"""


def _flight_file(folder: Path) -> Path:
    """Write one antenna's hour at 10 Hz with twelve satellites: 30 MB."""
    rng = np.random.default_rng(1)
    n, m = 36_000, 12
    t_s = np.arange(n) / 10
    code_m = rng.uniform(2e7, 2.5e7, m) + 500 * t_s[:, None, None]
    observations = Observations(
        t_s=t_s,
        tag_s=t_s[:, None],
        satellites=tuple(f"G{k + 1:02d}" for k in range(m)),
        signals=("1C",) * m,
        code_m=code_m,
        phase_cycles=code_m / 0.19,
        doppler_hz=rng.normal(0, 1000, (n, 1, m)),
        cn0_dbhz=np.full((n, 1, m), 45.25),
        lock_flags=np.zeros((n, 1, m)),
    )
    write_observations(
        folder / "hour.rnx",
        observations,
        0,
        start_gps_s=START_GPS_S,
        marker="a1",
        position_e_m=np.array([4e6, 1e6, 4.8e6]),
    )
    return folder / "hour.rnx"


def _compare(name: str, path: Path, note: str) -> Row:
    """Return the median seconds of both, in turns, so that a busy machine is fair to both."""
    read_rinex([], [path], START_GPS_S)  # compiles the kernels
    ours, peer = [], []
    for _ in range(REPEATS):
        start = time.perf_counter()
        read_rinex([], [path], START_GPS_S)
        ours.append(time.perf_counter() - start)
        command = [sys.executable, "-c", PEER, str(path), "1"]
        peer += json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    ours_s, peer_s = float(np.median(ours)), float(np.median(peer))
    note += "; peer: RTKLIB's readrnx alone, pyrtklib5, without any check or start-up"
    return row(name, ours_s, peer_s, "s", note, less=True)


def run() -> list[Row]:
    """Measure an hour at 10 Hz of our own making and, where it is there, a real 15 min at 1 Hz."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = _flight_file(folder)
        megabytes = path.stat().st_size / 1e6
        results = [_compare("rinex_read", path, f"1 h, 10 Hz, 12 satellites, {megabytes:.0f} MB")]
        if GRAS.is_file():
            plain = folder / "gras.rnx"
            plain.write_bytes(read_text(GRAS).tobytes())
            note = "15 min, 1 Hz, all systems, 7 MB"
            results.append(_compare("rinex_read_short", plain, note))
    return results

"""Observations and messages against other readers, value by value: RTKLIB's, and georinex.

RTKLIB's runs in a process of its own. georinex is no dependency: where it is absent, its tests are
skipped.
"""

import json
import subprocess
import sys

import numpy as np
import pytest

from fgnav.io.rinex.reader import read_navigation, read_rinex
from tests.io.rinex_texts import observation_2

START_GPS_S = 1_277_078_400.0  # 2020-06-25
PEER = """
import json, sys, pyrtklib5 as rtk
letters = {rtk.SYS_GPS: "G", rtk.SYS_GAL: "E", rtk.SYS_CMP: "C", rtk.SYS_GLO: "R", rtk.SYS_QZS: "J"}
obs, nav, station = rtk.obs_t(), rtk.nav_t(), rtk.sta_t()
rtk.readrnx(sys.argv[1], 1, "", obs, nav, station)
rows = []
for k in range(obs.n):
    one, number = obs.data[k], rtk.Arr1Dint(1)
    letter = letters.get(rtk.satsys(one.sat, number))
    for j in range(3):
        if letter and one.code[j]:
            values = one.P[j], one.L[j], one.D[j], one.SNR[j]
            time = one.time.time + one.time.sec - 315964800
            rows.append((time, f"{letter}{number[0]:02d}", rtk.code2obs(one.code[j]), *values))
print(json.dumps(rows))
"""


@pytest.mark.parametrize("name", ["WTZR", "WTZZ"])
def test_every_signal_that_rtklib_keeps_has_the_same_values(shared, name):
    pytest.importorskip("pyrtklib5")
    path = next((shared / "wettzell").glob(f"{name}*.rnx"))
    command = [sys.executable, "-c", PEER, str(path)]
    rows = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    (got,) = read_rinex([], [path], START_GPS_S)[1]
    column = {pair: m for m, pair in enumerate(zip(got.satellites, got.signals, strict=True))}
    shared_rows = [row for row in rows if (row[1], row[2]) in column]
    assert len(shared_rows) > 0.8 * len(rows)
    n = np.rint([(row[0] - START_GPS_S) / 30 for row in shared_rows]).astype(int)
    m = np.array([column[row[1], row[2]] for row in shared_rows])
    for k, field in enumerate(("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz"), 3):
        want = np.array([row[k] for row in shared_rows])
        ours = np.nan_to_num(getattr(got, field)[n, 0, m])
        np.testing.assert_allclose(ours, want, rtol=1e-6 if k > 4 else 0, atol=1e-3 * (k > 5))


FIELDS = {"C": "code_m", "L": "phase_cycles", "D": "doppler_hz", "S": "cn0_dbhz"}
EPOCHS = 12  # of a station's 120: georinex takes .1 s for each


def georinex():
    """Return the library, without its warnings of what xarray will change."""
    return pytest.importorskip("georinex", reason="georinex is not installed")


def first_epochs(path):
    """Return a file's head and its first epochs."""
    lines = path.read_text().splitlines(keepends=True)
    begins = [k for k, line in enumerate(lines) if line.startswith("> ")]
    return "".join(lines[: begins[EPOCHS]])


@pytest.mark.filterwarnings("ignore::FutureWarning")
@pytest.mark.parametrize("name", ["WTZR", "WTZZ", "RINEX 2"])
def test_georinex_has_the_same_observations(shared, tmp_path, name):
    library = georinex()
    path = tmp_path / "a.rnx"
    if name == "RINEX 2":
        path.write_text(observation_2(satellites=9))
    else:
        path.write_text(first_epochs(next((shared / "wettzell").glob(f"{name}*.rnx"))))
    theirs = library.load(path, use={"G"} if name == "RINEX 2" else set("GECRJ"))
    (ours,) = read_rinex([], [path], START_GPS_S)[1]
    start = np.datetime64("2020-06-25")
    t_s = (theirs.time.values.astype("datetime64[us]") - start) / np.timedelta64(1, "s")
    np.testing.assert_allclose(ours.t_s, t_s, rtol=0, atol=1e-6)
    compared = 0
    for m, (satellite, signal) in enumerate(zip(ours.satellites, ours.signals, strict=True)):
        for letter, field in FIELDS.items():
            named = {"1C": "1", "2W": "2"}[signal] if name == "RINEX 2" else signal
            variable = "P2" if (letter, named) == ("C", "2") else f"{letter}{named}"
            if variable in theirs and satellite in theirs.sv.values:
                want = theirs[variable].sel(sv=satellite).values
                got = getattr(ours, field)[:, 0, m]
                np.testing.assert_array_equal(
                    got, np.where(want == 0, np.nan, want).astype(got.dtype), variable
                )
                compared += int(np.isfinite(got).sum())
    assert compared > 100 * len(t_s) or name == "RINEX 2"


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_georinex_has_the_same_messages(shared, tmp_path):
    library = georinex()
    path = shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"
    lines = path.read_text().splitlines(keepends=True)
    size = next(k for k, one in enumerate(lines) if "END OF HEADER" in one) + 1
    begins = [k for k, one in enumerate(lines[size:], size) if one[0] == "G"][:16]
    text = [*lines[:size], *(line for k in begins for line in lines[k : k + 8])]
    (tmp_path / "n.rnx").write_text("".join(text))
    theirs = library.load(tmp_path / "n.rnx")
    ours = read_navigation([tmp_path / "n.rnx"], START_GPS_S).records
    names = {"af0_s": "SVclockBias", "mean_anomaly_rad": "M0", "eccentricity": "Eccentricity"}
    names |= {"toe_sow_s": "Toe", "perigee_rad": "omega", "node_rate_radps": "OmegaDot"}
    names |= {"crs_m": "Crs", "cic_rad": "Cic", "inclination_rate_radps": "IDOT"}
    start = np.datetime64("2020-06-25")
    times = (theirs.time.values.astype("datetime64[us]") - start) / np.timedelta64(1, "s")
    for record in ours:
        (row,) = np.flatnonzero(times == record["toc_s"])
        for field, name in names.items():
            assert record[field] == theirs[name].sel(sv=record["satellite"]).values[row]
    assert len(ours) == 16

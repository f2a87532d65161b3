"""Observations against RTKLIB's reader, value by value; it runs in a process of its own."""

import json
import subprocess
import sys

import numpy as np
import pytest

from fgnav.io.rinex.reader import read_rinex

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

"""RTKLIB's moving-base solution of a flight folder, through its Python binding."""

from pathlib import Path

import numpy as np
import pyrtklib5 as rk

from tests.gnss.recordings import START_UNIX_S

FIXED = 1  # RTKLIB's SOLQ_FIX
_SETTINGS = {
    "mode": rk.PMODE_MOVEB,
    "dynamics": 0,  # its model of motion, constant acceleration, lags a swinging body by 0.1 m
    "nf": 1,
    "elmin": np.radians(10.0),
    "navsys": rk.SYS_GPS | rk.SYS_GAL | rk.SYS_CMP,
    "modear": rk.ARMODE_CONT,
    "ionoopt": rk.IONOOPT_BRDC,
    "tropopt": rk.TROPOPT_SAAS,
}
# RTKLIB rejects phases that lie further than this from its prediction, 5 m unless told. Without a
# model of motion it predicts that the vehicle stays, and 100 m/s is 10 m from epoch to epoch.
_REJECTED_M = 1000.0


def baselines(folder: Path, antenna: str):
    """Return times (n,), status (n,) and baselines from a1 in ECEF (n, 3)."""
    obs, nav, station = rk.obs_t(), rk.nav_t(), rk.sta_t()
    files = ((f"{antenna}.rnx", 1), ("a1.rnx", 2), ("broadcast.rnx", 1))
    for name, receiver in files:
        rk.readrnx(str(folder / name), receiver, "", obs, nav, station)
    rk.uniqnav(nav)
    rk.sortobs(obs)
    filtering = _filter()
    data = [obs.data[k] for k in range(obs.n)]
    t_s = np.array([one.time.time - START_UNIX_S + one.time.sec for one in data])
    rows = []
    for epoch in np.split(np.arange(len(data)), 1 + np.nonzero(np.diff(t_s) > 1e-3)[0]):
        buffer = rk.Arr1Dobsd_t(len(epoch))
        for k, row in enumerate(epoch):
            buffer[k] = data[row]
        rk.rtkpos(filtering, buffer.ptr, len(epoch), nav)
        arm = [filtering.sol.rr[k] - filtering.rb[k] for k in range(3)]
        rows.append((t_s[epoch[0]], filtering.sol.stat, *arm))
    rk.rtkfree(filtering)
    table = np.array(rows)
    return table[:, 0], table[:, 1].astype(int), table[:, 2:]


def _filter():
    """Return RTKLIB's filter with our settings; its one set of defaults is put back afterwards."""
    options = rk.prcopt_default
    before = {name: getattr(options, name) for name in _SETTINGS}
    rejected_m = [options.maxinno[k] for k in range(2)]
    for name, value in _SETTINGS.items():
        setattr(options, name, value)
    filtering = rk.rtk_t()
    for k in range(2):
        options.maxinno[k] = _REJECTED_M
    rk.rtkinit(filtering, options)
    for name, value in before.items():
        setattr(options, name, value)
    for k in range(2):
        options.maxinno[k] = rejected_m[k]
    return filtering

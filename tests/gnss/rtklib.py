"""RTKLIB as an independent implementation."""

from pathlib import Path

import numpy as np
import pyrtklib5 as rk

from fgnav.checks import FloatArray
from tests.gnss.recordings import START_UNIX_S

_FIELDS = {
    "A": "semi_major_axis_m",
    "e": "eccentricity",
    "i0": "inclination_rad",
    "idot": "inclination_rate_radps",
    "OMG0": "node_rad",
    "OMGd": "node_rate_radps",
    "omg": "perigee_rad",
    "M0": "mean_anomaly_rad",
    "deln": "mean_motion_difference_radps",
    "cuc": "cuc_rad",
    "cus": "cus_rad",
    "crc": "crc_m",
    "crs": "crs_m",
    "cic": "cic_rad",
    "cis": "cis_rad",
    "f0": "af0_s",
    "f1": "af1_sps",
    "f2": "af2_sps2",
    "toes": "toe_sow_s",
}


def array(values: FloatArray) -> rk.Arr1Ddouble:
    out = rk.Arr1Ddouble(len(values))
    for k, value in enumerate(values):
        out[k] = float(value)
    return out


def time(t_s: float) -> rk.gtime_t:
    """Return a time since the start of the recordings."""
    zero = rk.gtime_t()
    zero.time, zero.sec = START_UNIX_S, 0.0
    return rk.timeadd(zero, float(t_s))


def broadcast_state(record: np.void, t_s: float) -> tuple[FloatArray, float]:
    """Return position and clock of one message."""
    eph = rk.eph_t()
    eph.sat = rk.satid2no(str(record["satellite"]))
    for theirs, ours in _FIELDS.items():
        setattr(eph, theirs, float(record[ours]))
    eph.toe, eph.toc = time(record["toe_s"]), time(record["toc_s"])
    position, clock, variance = (rk.Arr1Ddouble(n) for n in (3, 1, 1))
    rk.eph2pos(time(t_s), eph, position, clock, variance)
    return np.array([position[k] for k in range(3)]), clock[0]


def navigation(path: Path) -> rk.nav_t:
    nav, obs, sta = rk.nav_t(), rk.obs_t(), rk.sta_t()
    rk.readrnx(str(path), 1, "", obs, nav, sta)
    rk.uniqnav(nav)
    return nav


def tables(path: Path) -> rk.nav_t:
    nav = rk.nav_t()
    rk.readsp3(str(path), nav, 0)
    return nav


def table_state(nav: rk.nav_t, satellite: str, t_s: float) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (6,), clock and drift (2,); empty where there is none."""
    state, clock, variance = (rk.Arr1Ddouble(n) for n in (6, 2, 1))
    if not rk.peph2pos(time(t_s), rk.satid2no(satellite), nav, 0, state, clock, variance):
        return np.empty(0), np.empty(0)
    return np.array([state[k] for k in range(6)]), np.array([clock[k] for k in range(2)])


def point_positions(path: Path, nav: rk.nav_t) -> tuple[FloatArray, FloatArray]:
    """Return times (n,) and positions (n, 3) of GPS, Galileo and BeiDou above 10 degrees."""
    obs, unused, sta = rk.obs_t(), rk.nav_t(), rk.sta_t()
    rk.readrnx(str(path), 1, "", obs, unused, sta)
    rk.sortobs(obs)
    options = rk.prcopt_default
    options.mode, options.nf, options.elmin = 0, 1, np.radians(10.0)
    options.navsys = rk.SYS_GPS | rk.SYS_GAL | rk.SYS_CMP
    options.ionoopt, options.tropopt = rk.IONOOPT_BRDC, rk.TROPOPT_SAAS
    data = [obs.data[k] for k in range(obs.n)]
    t_s = np.array([one.time.time - START_UNIX_S + one.time.sec for one in data])
    times, positions = [], []
    for epoch in np.split(np.arange(len(data)), 1 + np.nonzero(np.diff(t_s) > 1e-3)[0]):
        buffer = rk.Arr1Dobsd_t(len(epoch))
        for k, row in enumerate(epoch):
            buffer[k] = data[row]
        solution = rk.sol_t()
        ok = rk.pntpos(
            buffer.ptr,
            len(epoch),
            nav,
            options,
            solution,
            rk.Arr1Ddouble(2 * len(epoch)),
            None,
            rk.Arr1Dchar(256),
        )
        if ok:
            times.append(t_s[epoch[0]])
            positions.append([solution.rr[k] for k in range(3)])
    return np.array(times), np.array(positions)

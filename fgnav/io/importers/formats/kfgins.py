"""Text files of KF-GINS and OB_GINS [1]_: increments of an inertial unit, fixes, a reference.

An increment is the mean over its interval, so its rate stands at the interval's middle. Axes are
forward, right, down; coning and sculling within an interval are left out.

References
----------
.. [1] i2Nav group, Wuhan University, KF-GINS: An EKF-Based GNSS/INS Integrated Navigation System,
   README, "Datasets".
"""

from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Unused
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.text_columns import complete_rows
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.io.tables import numbers
from fgnav.io.user_files import read_lines

_GRAVITY_MPS2 = (5.0, 15.0)  # half to one and a half of a vehicle's mean specific force, 9.8
_LONG = 1.5  # of the usual interval: the unit's clock has a gap there


def read_kfgins(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    r"""Read one file, told by its columns: 7 of increments or fixes, 11 of a reference.

    Examples
    --------
    >>> fixes = "456300 30.4 114.4 22 .01 .01 .02\n456301 30.4 114.4 23 .01 .01 .02\n"
    >>> _ = Path("gnss.txt").write_text(fixes)
    >>> read_kfgins(Path("gnss.txt"), Settings(), Path()).clock
    'week'
    """
    text, lost = read_lines(path)
    rows = [line.split() for line in text if line[:1] not in ("#", "%")]
    cells, cut = complete_rows(path, rows)
    x = numbers(cells)
    good = np.isfinite(x).all(axis=1)
    damaged = Unused(
        what=f"{path.name} line", reason="a cell is no number", count=int((~good).sum())
    )
    x, unused = x[good], (lost, cut, damaged)
    if x.shape[1] not in (7, 11) or len(x) < 2:
        raise BadInputError(
            f"{path}: must have two rows of numbers or more, of 7 columns (increments, fixes) or "
            f"11 (reference), has {len(x)} of {x.shape[1]}"
        )
    if x.shape[1] == 11:
        names = col.PLACE + col.VELOCITY + col.EULER
        tables = {"truth": samples(x[:, 1], (names, x[:, 2:]))}
        start = {"gps_start_s": WEEK_S * x[0, 0], "truth_source": "filter"}
        return Recording(source=path, tables=tables, unused=unused, **start)
    fixes = samples(x[:, 0], (col.PLACE + col.POSITION_SIGMA, x[:, 1:]))
    tables = {"imu": _rates(x)} if is_increments(x) else {"fixes": fixes}
    return Recording(source=path, tables=tables, clock="week", unused=unused)


def is_increments(x: FloatArray) -> bool:
    """Tell increments from fixes: a vehicle's specific force is gravity's, in the mean."""
    step_s = float(np.median(np.diff(x[:, 0])))
    force_mps2 = np.median(np.linalg.norm(x[:, 4:], axis=1)) / step_s if step_s > 0 else 0.0
    return bool(_GRAVITY_MPS2[0] < force_mps2 < _GRAVITY_MPS2[1])


def _rates(x: FloatArray) -> Samples:
    """Return rates and specific forces at the middles of the intervals that end at each row."""
    usual_s = float(np.median(np.diff(x[:, 0])))
    step_s = np.diff(x[:, 0], prepend=x[0, 0] - usual_s)
    step_s = np.where((step_s > 0) & (step_s < _LONG * usual_s), step_s, usual_s)
    rates = x[:, 1:] / step_s[:, None]
    return samples(x[:, 0] - step_s / 2, (col.FORCE, rates[:, 3:]), (col.RATE, rates[:, :3]))

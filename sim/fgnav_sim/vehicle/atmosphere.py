"""Air: the US standard atmosphere as a table, winds by height, turbulence along the path."""

from functools import cache
from itertools import pairwise

import numpy as np

from fgnav.checks import BadInputError, FloatArray, frozen, positive

GEOPOTENTIAL_RADIUS_M = 6_356_766.0  # US-1976, the radius that turns height into geopotential
GUST_INTERVAL_M = 5.0  # of turbulence, along the path
FLOOR_M, CELL_M = -5000.0, 100.0  # geopotential heights of the table's first cell
_LAYERS_M = (-5000, 0, 11000, 20000, 32000, 47000, 51000, 71000, 80000)  # US-1976, geopotential


@cache
def us_1976() -> FloatArray:
    """Return density and speed of sound of the US-1976 atmosphere as cubics of height.

    Every layer has a spline of its own, as the lapse rate jumps between layers. The table is within
    1e-8 of the model, which itself costs 0.4 ms a call.

    Returns
    -------
    ndarray, shape (cells, 8)
        For each 100 m of geopotential height from -5 km: four coefficients of density, kg/m3, and
        four of the speed of sound, m/s, highest power first, of the height above the cell's floor.
    """
    from ambiance import Atmosphere  # type: ignore[import-untyped]  # noqa: PLC0415  # lazy
    from scipy.interpolate import CubicSpline  # noqa: PLC0415  # lazy

    cells = []
    for floor_m, top_m in pairwise(_LAYERS_M):
        height_m = np.arange(floor_m, top_m + 1.0, CELL_M)
        geometric_m = GEOPOTENTIAL_RADIUS_M * height_m / (GEOPOTENTIAL_RADIUS_M - height_m)
        geometric_m[[0, -1]] += [1e-6, -1e-6]  # the model jumps by 4e-6 where layers meet
        air = Atmosphere(geometric_m)
        both = CubicSpline(height_m, np.stack([air.density, air.speed_of_sound], axis=1))
        cells.append(both.c.transpose(1, 2, 0).reshape(-1, 8))
    table = np.ascontiguousarray(np.concatenate(cells))
    table.flags.writeable = False
    return table


def vacuum() -> FloatArray:
    """Return a table like that of ``us_1976`` with no density in it."""
    table = np.array([[0.0] * 7 + [1.0]])
    table.flags.writeable = False  # one type of array, so that code is compiled once
    return table


def dryden(
    rng: np.random.Generator,
    *,
    sigma_mps: float,
    direction_n: FloatArray,
    length_m: float,
    scale_m: float = 533.4,
) -> FloatArray:
    """Return gusts with Dryden's spectra along a straight path through frozen turbulence.

    Longitudinal gusts are a first-order process, transverse ones a second-order process of the
    distance, both sampled exactly; the three components are independent and of equal strength, as
    MIL-F-8785C has it above 2000 ft [1]_.

    Parameters
    ----------
    sigma_mps : float
        Standard deviation of each component.
    direction_n : ndarray, shape (3,)
        Mean direction of flight, north-east-down.
    length_m : float
        Distance to cover.
    scale_m : float
        Scale of turbulence; 1750 ft above 2000 ft.

    Returns
    -------
    ndarray, shape (g, 3)
        North, east, down components, m/s, every ``GUST_INTERVAL_M`` of the path.

    References
    ----------
    .. [1] MIL-F-8785C, section 3.7.1.2, Dryden form.
    """
    for name, value in (("sigma_mps", sigma_mps), ("length_m", length_m), ("scale_m", scale_m)):
        positive(name, value)
    along = frozen("direction_n", direction_n, (3,))
    if not along.any():
        raise BadInputError("direction_n: must not be zero")
    count = int(np.ceil(length_m / GUST_INTERVAL_M)) + 1
    first, _ = _markov_pair(rng, count, GUST_INTERVAL_M / scale_m)
    gust = np.empty((count, 3))
    gust[:, 0] = np.sqrt(2) * first
    for axis in (1, 2):
        first, second = _markov_pair(rng, count, GUST_INTERVAL_M / scale_m)
        gust[:, axis] = np.sqrt(3) * first + (1 - np.sqrt(3)) * second
    basis = np.linalg.qr(np.column_stack([along, np.eye(3)]))[0]
    basis[:, 0] *= np.sign(basis[:, 0] @ along)
    return np.asarray(sigma_mps * gust @ basis.T)


def _markov_pair(
    rng: np.random.Generator, count: int, step: float
) -> tuple[FloatArray, FloatArray]:
    """Return steady samples of ``x1' = -x1 + w``, ``x2' = -x2 + x1`` at equal steps, each (n,).

    ``w`` is white with unit density, so that ``x1`` has variance 1/2, and both others are 1/4.
    """
    from scipy.signal import lfilter  # noqa: PLC0415  # lazy: keeps the command line quick

    steady = np.array([[0.5, 0.25], [0.25, 0.25]])
    F = np.exp(-step) * np.array([[1.0, 0.0], [step, 1.0]])
    noise = rng.standard_normal((count, 2)) @ np.linalg.cholesky(steady - F @ steady @ F.T).T
    noise[0] = np.linalg.cholesky(steady) @ rng.standard_normal(2)
    first = lfilter([1.0], [1.0, -F[0, 0]], noise[:, 0])
    noise[1:, 1] += F[1, 0] * first[:-1]
    return first, lfilter([1.0], [1.0, -F[0, 0]], noise[:, 1])

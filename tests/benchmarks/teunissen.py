"""A published table of success rates: one baseline of 2 m, one epoch, GPS L1, 5 to 8 satellites.

The table [1]_ states noise of undifferenced code and phase, and counts right answers of LAMBDA and
of the search of known length. Neither its satellites nor the direction of its baseline are known
to us, nor how many sets it drew; its PDOP is, and two decimals of a percentage take 10,000 sets.

Satellites are those that real broadcast orbits show at some place and time, or some of them, such
that their PDOP is the published one; of these that sky is taken which repeats the table's nine
LAMBDA rates best. Under it the known length is tried in all level directions: its rates are no
choice of ours. Phase noise of 30 mm leaves nothing but PDOP and noise to decide on LAMBDA's rate:
that these cells agree says that noise is meant as here.

A cell is below where the published rate is above ours by more than chance, two-sided 95 % of both
numbers of sets. Every answer is held against the cost of the true integers, which are known: one
that costs more would be the search's fault. Orbits and table are read from FGNAV_SHARED; without
it there are no rows.

References
----------
.. [1] P. J. G. Teunissen, G. Giorgi, P. J. Buist, "Testing of a new single-frequency GNSS carrier
   phase attitude determination method: land, ship and aircraft experiments", GPS Solutions 15,
   2011.
"""

import json
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry import earth
from fgnav.gnss.orbits.satellites import satellite_states
from fgnav.integers.array.candidates import candidates
from fgnav.integers.ils.search import WITHOUT_LIMIT, solve
from fgnav.io.rinex.reader import read_navigation
from fgnav.types.differences import DoubleDifferences
from fgnav.types.orbits import BroadcastOrbits
from tests.benchmarks._rows import DATA, Row, row
from tests.integers.arrays import L1_M

PDOP = {5: 4.19, 6: 2.14, 7: 1.91, 8: 1.81}
SAME = 0.01  # how near it must be, of itself
LENGTH_M = 2.0
LOWEST_RAD = np.radians(5.0)
MESSAGES = "brdc1820.10n"  # GPS, all day: 1 July 2010
START_GPS_S = 1590 * 604_800.0 + 4 * 86_400.0
GPS = tuple(f"G{number:02d}" for number in range(1, 33))
STEP_S, STEP_DEG = 600.0, (5.0, 10.0)  # from sky to sky: time, latitude and longitude
MOST, LEADING = 3000, 60  # skies tried, and again
FEW, MORE, MANY = 300, 2000, 20_000  # sets of LAMBDA for them, and for the table
DIRECTIONS, SETS = 18, 2000  # level ones of the baseline, over half a turn, and sets of each
PUBLISHED = 10_000
LIKELY = 1.96  # sigmas of two-sided 95 %
NODES = 10**7
NAMES = (
    "teunissen_cells",
    *(
        f"teunissen_{s}_{phase}mm_{code}cm"
        for s in PDOP
        for phase in (30, 3, 1)
        for code in (30, 15, 5)
    ),
)

Cell = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Rates:
    """What became of one cell, rates in %."""

    cell: Cell
    free: float  # LAMBDA
    known: FloatArray  # (DIRECTIONS,)
    dearer: int  # answers that cost more than the true integers
    given_up: int

    @property
    def below(self) -> bool:
        """Say whether the published rate is above that over all directions, beyond chance."""
        return bool(below(self.known.mean(), DIRECTIONS * SETS, self.cell["C_LAMBDA_pct"]))


def run() -> list[Row]:
    """Return a row per cell of the table, and one of them all."""
    table = DATA / "integers" / "c_lambda_success_rates_teunissen2011.json"
    messages = DATA / "orbits" / MESSAGES
    if not (table.is_file() and messages.is_file()):
        return []
    cells = json.loads(table.read_text())["table1"]["rows"]
    orbits = read_navigation([messages], START_GPS_S)
    rng = np.random.default_rng(2011)
    found = []
    for s in PDOP:
        of_s = [cell for cell in cells if cell["n_sat"] == s]
        e_n = nearest_sky(orbits, s, of_s, rng)
        found.append([rates(e_n, cell, rng) for cell in of_s])
    return [_summary(found), *(_row(one) for of_sky in found for one in of_sky)]


def below(ours: FloatArray | float, sets: int, published: float) -> BoolArray:
    """Return whether a published rate is above ours, %, by more than chance."""
    a, b = np.asarray(ours) / 100.0, published / 100.0
    # a rate of 0 or 1 is uncertain as well: half a set more and half a set less
    a_near = (a * sets + 0.5) / (sets + 1)
    b_near = (b * PUBLISHED + 0.5) / (PUBLISHED + 1)
    variance = a_near * (1 - a_near) / sets + b_near * (1 - b_near) / PUBLISHED
    return np.asarray(b - a > LIKELY * np.sqrt(variance))


def nearest_sky(
    orbits: BroadcastOrbits, s: int, cells: list[Cell], rng: np.random.Generator
) -> FloatArray:
    """Return directions, (s, 3), under which LAMBDA does most nearly what is published."""
    skies = _skies(orbits, s, rng)[:MOST]
    for sets, kept in ((FEW, LEADING), (MORE, 1)):
        skies = skies[np.argsort([_apart(e_n, cells, sets) for e_n in skies])[:kept]]
    return np.asarray(skies[0])


def rates(e_n: FloatArray, cell: Cell, rng: np.random.Generator) -> Rates:
    """Return the rates under one sky."""
    known, dearer, given_up = np.zeros(DIRECTIONS), 0, 0
    for i, yaw_rad in enumerate(np.arange(DIRECTIONS) * np.pi / DIRECTIONS):
        d = made(e_n, cell, float(yaw_rad), rng)
        # the best alone: nothing that costs more is looked for
        found = candidates(d, most=1, reach=1e-9, nodes=NODES)
        right = (found.cycles == 0).all(axis=(1, 2))
        known[i] = 100.0 * right.sum() / SETS
        dearer += int((found.cost > cost_of_truth(d)[found.epoch] + 1e-6).sum())
        given_up += int((found.status > 1).sum())
    free = _free(e_n, cell, MANY, rng)
    return Rates(cell=cell, free=free, known=known, dearer=dearer, given_up=given_up)


def made(
    e_n: FloatArray, cell: Cell, yaw_rad: float, rng: np.random.Generator
) -> DoubleDifferences:
    """Return sets of a level baseline of 2 m whose integers are all zero."""
    s = len(e_n)
    code_m, phase_m = _sigmas_m(cell)
    range_m = -LENGTH_M * (e_n @ [np.cos(yaw_rad), np.sin(yaw_rad), 0.0])

    def measured(sigma_m: float) -> FloatArray:
        single = range_m + sigma_m * np.sqrt(2.0) * rng.normal(size=(SETS, 1, s))
        return np.asarray(single - single[:, :, :1])

    return DoubleDifferences(
        t_s=np.arange(float(SETS)),
        baselines_b_m=np.array([[LENGTH_M, 0.0, 0.0]]),
        satellites=GPS[:s],
        signals=("1C",) * s,
        wavelength_m=np.full(s, L1_M),
        group=np.zeros(s, dtype=np.int64),
        reference=np.zeros((SETS, 1), dtype=np.int64),
        e_n=np.tile(e_n, (SETS, 1, 1)),
        elevation_rad=np.tile(np.arcsin(-e_n[:, 2]), (SETS, 1)),
        code_m=measured(code_m),
        phase_m=measured(phase_m),
        code_variance_m2=np.full((SETS, s), code_m**2),
        phase_variance_m2=np.full((SETS, s), phase_m**2),
        arc=np.zeros((SETS, 1, s), dtype=np.int64),
    )


def cost_of_truth(d: DoubleDifferences) -> FloatArray:
    """Return the least cost of integers that are all zero, (n,), written apart from the search.

    Alike noise of all satellites makes double differences what single ones are without their mean.
    """
    A = -(d.e_n[0] - d.e_n[0].mean(axis=0))
    parts = ((d.code_m, d.code_variance_m2[0, 0]), (d.phase_m, d.phase_variance_m2[0, 0]))
    singles = [((y - y.mean(axis=2, keepdims=True))[:, 0], 2.0 * v) for y, v in parts]
    values, axes = np.linalg.eigh(sum(A.T @ A / v for _, v in singles))
    g = sum(y @ A / v for y, v in singles) @ axes
    at_zero = sum((y**2).sum(axis=1) / v for y, v in singles)
    # the minimum of x.N.x - 2 g.x at |x| = LENGTH_M solves (N - mu) x = g with mu below N
    low, high = values[0] - np.linalg.norm(g, axis=1) / LENGTH_M, np.full(len(g), values[0])
    for _ in range(100):
        mu = 0.5 * (low + high)
        longer = ((g / (values - mu[:, None])) ** 2).sum(axis=1) > LENGTH_M**2
        low, high = np.where(longer, low, mu), np.where(longer, mu, high)
    x = g / (values - low[:, None])
    return np.asarray(at_zero + (values * x**2).sum(axis=1) - 2.0 * (g * x).sum(axis=1))


def _skies(orbits: BroadcastOrbits, s: int, rng: np.random.Generator) -> FloatArray:
    """Return skies of the published PDOP, (k, s, 3), satellites drawn from those in view."""
    t_s = np.arange(0.0, 86_400.0, STEP_S)
    p_e_m = satellite_states(orbits, GPS, np.tile(t_s[:, None], (1, len(GPS)))).p_e_m
    found = []
    for latitude_deg in np.arange(-80.0, 81.0, STEP_DEG[0]):
        for longitude_deg in np.arange(0.0, 360.0, STEP_DEG[1]):
            e_n = _directions(p_e_m, latitude_deg, longitude_deg)
            drawn = np.where(_seen(e_n), rng.random(e_n.shape[:2]), np.inf)
            some = np.argsort(drawn, axis=1)[:, :s]
            e_n = np.take_along_axis(e_n, some[:, :, None], axis=1)
            found.append(e_n[fits(e_n)])
    return rng.permutation(np.concatenate(found))


def _directions(p_e_m: FloatArray, latitude_deg: float, longitude_deg: float) -> FloatArray:
    """Return those to satellites from a place, (n, m, 3)."""
    place = np.radians([[latitude_deg], [longitude_deg]])
    los = p_e_m - earth.ecef(place[0], place[1], np.zeros(1))
    los /= np.linalg.norm(los, axis=2, keepdims=True)
    return np.asarray(los @ earth.ned_axes(place[0], place[1])[0].T)


def _seen(e_n: FloatArray) -> BoolArray:
    """Return which satellites are there and high enough, (n, m)."""
    return np.asarray(-np.nan_to_num(e_n[..., 2]) > np.sin(LOWEST_RAD))


def fits(e_n: FloatArray) -> BoolArray:
    """Return which skies, (n, s, 3), are seen whole and have the published PDOP."""
    n, s, _ = e_n.shape
    there = _seen(e_n).all(axis=1)
    H = np.concatenate([-e_n, np.ones((n, s, 1))], axis=2)
    N = np.where(there[:, None, None], H.swapaxes(1, 2) @ H, np.eye(4))
    there &= np.linalg.cond(N) < 1e9
    N[~there] = np.eye(4)
    pdop = np.sqrt(np.trace(np.linalg.inv(N)[:, :3, :3], axis1=1, axis2=2))
    return np.asarray(there & (abs(pdop / PDOP[s] - 1.0) < SAME))


def _apart(e_n: FloatArray, cells: list[Cell], sets: int) -> float:
    """Return how far LAMBDA's rates are from the published ones, the same noise for each sky."""
    rng = np.random.default_rng(1)
    return float(sum((_free(e_n, cell, sets, rng) - cell["LAMBDA_pct"]) ** 2 for cell in cells))


def _sigmas_m(cell: Cell) -> tuple[float, float]:
    return 1e-2 * cell["sigma_code_cm"], 1e-3 * cell["sigma_phase_mm"]


def _free(e_n: FloatArray, cell: Cell, sets: int, rng: np.random.Generator) -> float:
    """Return LAMBDA's share of right answers, %."""
    D = e_n[:1] - e_n[1:]
    C = 2.0 * (np.eye(len(D)) + 1.0)
    code_m, phase_m = _sigmas_m(cell)
    of_baseline = np.linalg.inv(D.T @ np.linalg.solve(code_m**2 * C, D))
    Q = (phase_m**2 * C + D @ of_baseline @ D.T) / L1_M**2
    Q = 0.5 * (Q + Q.T)
    floats = rng.normal(size=(sets, len(Q))) @ np.linalg.cholesky(Q).T
    found = np.array([solve(a, Q, 1, WITHOUT_LIMIT)[1][0] for a in floats])
    return 100.0 * float((found == 0).all(axis=1).mean())


def _row(of: Rates) -> Row:
    peer, known = of.cell["C_LAMBDA_pct"], float(of.known.mean())
    reached = (~below(of.known, SETS, peer)).sum()
    note = (
        f"known length; by direction of the baseline {of.known.min():.1f} to {of.known.max():.1f}, "
        f"{reached} of {DIRECTIONS} reach the published rate; "
        f"LAMBDA {of.free:.1f} against {of.cell['LAMBDA_pct']:.1f} published"
        + ("; BELOW over all directions" if of.below else "")
    )
    name = f"teunissen_{of.cell['n_sat']}_{of.cell['sigma_phase_mm']}mm"
    return row(f"{name}_{of.cell['sigma_code_cm']}cm", known, peer, "%", note)


def _summary(found: list[list[Rates]]) -> Row:
    cells = [one for of_sky in found for one in of_sky]
    near = sum(abs(one.free - one.cell["LAMBDA_pct"]) <= 2.0 for one in cells)
    level = sum(not one.below for one in cells)
    note = (
        f"cells where the known length is not below the published rate, over all directions of the "
        f"baseline; that of the paper had one, unknown to us; LAMBDA within 2 points in {near} of "
        f"{len(cells)}; answers that cost more than the true integers: "
        f"{sum(one.dearer for one in cells)} of {len(cells) * DIRECTIONS * SETS}, searches given "
        f"up: {sum(one.given_up for one in cells)}"
    )
    return row("teunissen_cells", level, len(cells), "count", note)

"""Declared against observed probability of a wrong fix, where noise is as stated and where not."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc
from scipy.stats import beta

from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.affine import search_array
from fgnav.integers.constrained_search import PROVEN, search_constrained
from fgnav.integers.thresholds import simulated
from fgnav.integers.validation import share_threshold
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make

SETS, NODES = 100_000, 10**5
WRONG_MAX, TAIL = 1e-3, 1e-4
SECONDS, TAU_S = 50, 60.0  # of one geometry in a row, under multipath of that time constant
SCENARIOS = tuple(
    f"wrong_fix_{name}" for name in ("declared", "louder_noise", "outliers", "multipath")
)
NAMES = (*SCENARIOS, "wrong_fix_caught")
OF_LAMBDA = 20_000


@dataclass(frozen=True, kw_only=True)
class Case:
    """An array under some satellites, and its share of the sets."""

    antennas_b_m: FloatArray
    satellites: int
    code_m: float
    share: float


THREE_B_M = PAPER_ANTENNAS_B_M[[0, 1, 3]]
TWO_B_M = PAPER_ANTENNAS_B_M[[0, 3]]
CASES = {
    "paper, 6 sat.": Case(antennas_b_m=PAPER_ANTENNAS_B_M, satellites=6, code_m=1.0, share=0.5),
    "3 ant., 5 sat.": Case(antennas_b_m=THREE_B_M, satellites=5, code_m=1.0, share=0.02),
    "3 ant., 4 sat.": Case(antennas_b_m=THREE_B_M, satellites=4, code_m=1.0, share=0.005),
    "2 ant., 7 sat.": Case(antennas_b_m=TWO_B_M, satellites=7, code_m=0.3, share=0.4),
    "2 ant., 6 sat.": Case(antennas_b_m=TWO_B_M, satellites=6, code_m=0.3, share=0.075),
}


@dataclass(frozen=True, kw_only=True)
class Tally:
    """Counts of one case in one scenario."""

    sets: int
    proven: int
    accepted: int
    declared: float  # wrong ones expected among the accepted
    wrong: int
    declared_of_all: float  # expected of all proven sets, accepted or not
    wrong_of_all: int
    far: (
        int  # wrong integers that move the attitude by more than a degree, likely by their own word
    )
    far_caught: int  # of these refused by chi-square


def run() -> list[dict[str, object]]:
    """Return a row for each scenario, its table in the note."""
    return [*(_row(name, tally(name, SETS)) for name in SCENARIOS), caught(OF_LAMBDA)]


def tally(name: str, sets: int) -> dict[str, Tally]:
    """Return the counts of every case in one scenario."""
    rng = np.random.default_rng(SCENARIOS.index(name) + 100)
    out = {}
    for case, what in CASES.items():
        parts, left = [], round(sets * what.share)
        while left > 0:
            parts.append(_part(rng, name, what, min(left, 10_000)))
            left -= 10_000
        out[case] = _total(parts)
    return out


def spoilt(rng: np.random.Generator, name: str, d: DoubleDifferences) -> DoubleDifferences:
    """Return the sets as a scenario has them; what is stated stays."""
    n, b, m = d.phase_m.shape
    shape = (n, b + 1, m)
    if name == "wrong_fix_louder_noise":
        less = {
            kind: getattr(d, kind) / 1.5**2 for kind in ("code_variance_m2", "phase_variance_m2")
        }
        return replace(d, **less)
    if name == "wrong_fix_outliers":
        bad = rng.random(shape) < 0.05
        sign = np.where(rng.random(shape) < 0.5, -1.0, 1.0) * bad
        return _with_errors(d, 1.5 * sign, 0.015 * sign)
    if name == "wrong_fix_multipath":
        code = np.sqrt(d.code_variance_m2)[:, None] * _ar1(rng, shape)
        phase = np.sqrt(d.phase_variance_m2)[:, None] * _ar1(rng, shape)
        return _with_errors(d, 0.75 * code, 0.75 * phase)
    return d


def _part(rng: np.random.Generator, name: str, case: Case, n: int) -> Tally:
    each = SECONDS if name == "wrong_fix_multipath" else 1
    d = make(
        rng,
        epochs=max(n // each, 1),
        antennas_b_m=case.antennas_b_m,
        satellites=(case.satellites,),
        code_m=case.code_m,
        sine=True,
    ).differences
    nominal = simulated(d, np.repeat(np.arange(len(d.t_s)), each)[:n], rng)
    sets = spoilt(rng, name, nominal)
    found = search_constrained(sets, NODES)
    proven = found.status == PROVEN
    wrong = (found.cycles != 0).any(axis=(1, 2))
    p = found.wrong_probability
    fits = chdtrc(np.maximum(found.degrees, 1), np.where(proven, found.costs[:, 0], 0.0)) >= TAIL
    sound = proven & fits
    sure = p <= -share_threshold(-p[sound], p[sound], WRONG_MAX)
    accepted = sound & sure
    far = np.flatnonzero(proven & wrong & sure)
    far = far[_turned_deg(sets, found.cycles, far)[0] > 1.0]
    return Tally(
        sets=len(p),
        proven=int(proven.sum()),
        accepted=int(accepted.sum()),
        declared=float(p[accepted].sum()),
        wrong=int((accepted & wrong).sum()),
        declared_of_all=float(p[proven].sum()),
        wrong_of_all=int((wrong & proven).sum()),
        far=len(far),
        far_caught=int((~fits[far]).sum()),
    )


def _total(parts: list[Tally]) -> Tally:
    names = Tally.__dataclass_fields__
    return Tally(**{name: sum(getattr(part, name) for part in parts) for name in names})


def _with_errors(d: DoubleDifferences, code: FloatArray, phase: FloatArray) -> DoubleDifferences:
    def double(links: FloatArray) -> FloatArray:
        single = links[:, 1:] - links[:, :1]
        of_reference = d.reference[:, d.group][:, None, :]
        return np.asarray(single - np.take_along_axis(single, of_reference, axis=2))

    return replace(d, code_m=d.code_m + double(code), phase_m=d.phase_m + double(phase))


def _ar1(rng: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Return series of unit variance along the first axis, started anew with each geometry."""
    keep = np.exp(-1.0 / TAU_S)
    out = rng.normal(size=shape)
    for k in range(1, shape[0]):
        if k % SECONDS:
            out[k] = keep * out[k - 1] + np.sqrt(1.0 - keep**2) * out[k]
    return out


def _turned_deg(
    d: DoubleDifferences, cycles: IntArray, at: IntArray
) -> tuple[FloatArray, AttitudeSolution | None]:
    """Return by how much integers turn the array from where the true ones see it, and the fit."""
    if len(at) == 0:
        return np.zeros(0), None
    ranges_m = np.where(d.is_reference[:, None], 0.0, d.phase_m)
    right, wrong = (
        maximum_likelihood(RotationQuadratic.of_ranges(d, ranges)[at])
        for ranges in (ranges_m, ranges_m - d.wavelength_m * cycles)
    )
    # what the baselines do counts: a turn about the line of two antennas is none
    l_n = [np.einsum("nij,bj->nbi", fit.R_nb, d.baselines_b_m) for fit in (right, wrong)]
    length_m = np.linalg.norm(d.baselines_b_m, axis=1)
    moved = np.linalg.norm(l_n[0] - l_n[1], axis=2) / length_m
    turned = np.degrees(2 * np.arcsin(np.clip(moved.max(axis=1) / 2, 0, 1)))
    return np.asarray(turned), wrong


def caught(sets: int) -> dict[str, object]:
    """Return how many wrong fixes of LAMBDA on the array of the paper its chi-square finds."""
    rng = np.random.default_rng(200)
    d = make(rng, epochs=sets, code_m=1.0, sine=True).differences
    d = simulated(d, np.arange(sets), rng)
    cycles = search_array(d, joint=True).cycles
    wrong = np.flatnonzero((cycles != 0).any(axis=(1, 2)))
    turned_deg, fit = _turned_deg(d, cycles, wrong)
    far = turned_deg > 1.0
    refused = np.zeros(len(wrong), dtype=np.bool_) if fit is None else ~fit.consistent(TAIL)
    share = 100.0 * float(refused[far].mean())
    note = (
        f"LAMBDA over the affine array, code 1 m: {len(wrong)} of {sets} wrong, {far.sum()} of "
        f"them turn the array by > 1 deg; chi-square of the rigid array at {TAIL:g} refuses "
        f"{refused[far].sum()} of these, {refused[~far].sum()} of the others; peer: the target"
    )
    row: dict[str, object] = {"name": "wrong_fix_caught", "ours": share, "peer": 99.0}
    return {**row, "ratio": share / 99.0, "unit": "%", "note": note}


def lower_bound(wrong: int, sets: int) -> float:
    """Return Clopper and Pearson's lower 95 % bound of a share."""
    return float(beta.ppf(0.05, wrong, sets - wrong + 1)) if wrong else 0.0


def holds(t: Tally) -> BoolArray:
    """Return whether the wrong ones, of all and of the accepted, are no more than declared."""
    of_all = lower_bound(t.wrong_of_all, t.proven) <= t.declared_of_all / t.proven
    accepted = lower_bound(t.wrong, max(t.accepted, 1)) <= t.declared / max(t.accepted, 1)
    return np.array([of_all, accepted])


def _row(name: str, tallies: dict[str, Tally]) -> dict[str, object]:
    told = []
    for case, t in tallies.items():
        told.append(
            f"{case}: {t.sets} sets, {t.proven} proven, declared {t.declared_of_all:.1f} wrong, "
            f"observed {t.wrong_of_all}; accepted {100 * t.accepted / t.sets:.1f} %, of these "
            f"declared {t.declared:.2f}, observed {t.wrong}"
            f"{'' if holds(t).all() else ' (MORE)'}; "
            f"turned by > 1 deg and sure of it {t.far}, chi-square caught {t.far_caught}"
        )
    total = _total(list(tallies.values()))
    observed = 100.0 * total.wrong / max(total.accepted, 1)
    declared = 100.0 * total.declared / max(total.accepted, 1)
    row: dict[str, object] = {"name": name, "ours": observed, "peer": declared}
    ratio = declared / observed if observed else None
    note = "% wrong of the accepted; peer: the declared share. " + ". ".join(told)
    return {**row, "ratio": ratio, "unit": "%", "note": note}

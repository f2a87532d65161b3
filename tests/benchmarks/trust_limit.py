"""How often four satellites can be trusted at all: the network beside the exact posterior.

Whoever knows share and size of bad links exactly, and noise as it is, has a posterior that nobody
can better. It sums over the 2^32 sets of links that may be bad; given attitude and offsets of
antennas and satellites, links are independent, and the sum is an integral over 25 unknowns. It is
found by importance sampling from Gaussians that belong to sets drawn by Gibbs' sampler. Candidates
are the network's: more of them could only lower it.
``TRUST_LIMIT_EPOCHS`` sets how many epochs.
"""

import os

import numpy as np
from numba import njit

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.array.candidates import Candidates, candidates
from fgnav.types.differences import DoubleDifferences
from fgnav_models.runtime.load import load
from fgnav_models.runtime.resolver import trusted
from fgnav_models.training.trust.score import SURE, Posteriors, summary
from fgnav_sim.data_sets.differences import double_differences_of, true_cycles
from fgnav_sim.data_sets.epochs import array_epochs
from tests.benchmarks.trust import NODES, hard_world

EPOCHS = int(os.environ.get("TRUST_LIMIT_EPOCHS", "300"))
NAMES = ("trust_limit_s4",)
SHARE, WORSE_M = 0.08, np.array([0.015, 1.5])  # of the world, for phase and code
BURN_IN, GAUSSIANS, APART, DRAWS = 30, 40, 5, 800
TURNS = 3  # linearisations of the attitude


def run() -> list[dict[str, object]]:
    """Compare how much is trusted."""
    drawn = array_epochs(hard_world(4), np.random.default_rng([99, 4, 1]), EPOCHS)
    differences = double_differences_of(drawn)
    true = true_cycles(drawn, differences)
    of = trusted(differences, load("trust"), nodes=NODES)
    found = candidates(differences, nodes=NODES)
    right = (found.cycles == true[found.epoch]).all(axis=(1, 2))
    trust, best = exact(differences, found)
    sure = summary(Posteriors(trust=trust, right=(best >= 0) & right[best], entropy=0.0))
    ours, limit = (
        100.0 * float((of.wrong_probability < 1.0 - SURE).mean()),
        sure["coverage_percent"],
    )
    note = (
        f"P > 0.999 with 4 satellites; peer: posterior that knows all of the world but the truth, "
        f"{sure['wrong_of_sure']:.0f} wrong, {EPOCHS} epochs"
    )
    row: dict[str, object] = {"name": "trust_limit_s4", "ours": ours, "peer": limit}
    return [{**row, "ratio": ours / limit, "unit": "%", "note": note}]


def exact(differences: DoubleDifferences, found: Candidates) -> tuple[FloatArray, IntArray]:
    """Return the posterior of each epoch's likeliest candidate, (n,), and that candidate's row."""
    evidence = np.array([_log_evidence(differences, found, r) for r in range(len(found.epoch))])
    n = len(differences.t_s)
    trust, best = np.zeros(n), np.full(n, -1)
    for k in np.unique(found.epoch):
        rows = np.flatnonzero(found.epoch == k)
        weight = np.exp(evidence[rows] - evidence[rows].max())
        trust[k], best[k] = weight.max() / weight.sum(), rows[np.argmax(weight)]
    return trust, best


def _log_evidence(d: DoubleDifferences, found: Candidates, r: int) -> float:
    """Return the log likelihood of a candidate, attitude and all offsets integrated out."""
    k, b_n_m = found.epoch[r], found.baselines_n_m[r]
    reference = d.reference[k, 0]
    apart_n = d.e_n[k] - d.e_n[k, reference]
    variance_m2 = np.stack([d.phase_variance_m2[k], d.code_variance_m2[k]])
    count = (len(b_n_m) + 1) * len(apart_n)
    channel = np.tile(np.arange(len(apart_n)), len(b_n_m) + 1)
    narrow = variance_m2[:, channel].ravel()
    wide = narrow + np.repeat(WORSE_M**2, count)
    for _ in range(TURNS):
        value_m, design = _model(d, found, r, b_n_m, apart_n, reference)
        x, worse = _likeliest(value_m, design, narrow, wide)
        turn = x[:3]
        size = max(float(np.linalg.norm(turn)), 1e-12)
        axis = turn / size
        across = np.cross(axis, b_n_m)
        along = np.outer(b_n_m @ axis, axis)
        b_n_m = along + np.cos(size) * (b_n_m - along) + np.sin(size) * across
    value_m, design = _model(d, found, r, b_n_m, apart_n, reference)
    return float(_integral(value_m, design, narrow, wide, worse, np.random.default_rng([5, r])))


def _model(
    d: DoubleDifferences,
    found: Candidates,
    r: int,
    b_n_m: FloatArray,
    apart_n: FloatArray,
    reference: int,
) -> tuple[FloatArray, FloatArray]:
    """Return phase and code of links less ranges, (2 l,), and what unknowns add, (2 l, u)."""
    k, a, m = found.epoch[r], len(b_n_m) + 1, len(apart_n)
    range_m = -b_n_m @ apart_n.T
    value_m = np.zeros((2, a, m))
    value_m[0, 1:] = d.phase_m[k] - d.wavelength_m * found.cycles[r] - range_m
    value_m[1, 1:] = d.code_m[k] - range_m
    arm = np.zeros((a, m, 3))
    arm[1:] = -np.cross(b_n_m[:, None], apart_n[None])
    antenna = np.repeat(np.eye(a), m, axis=0)
    satellite = np.delete(np.tile(np.eye(m), (a, 1)), reference, axis=1)
    offsets = np.hstack([antenna, satellite])
    none = np.zeros_like(offsets)
    arm = arm.reshape(a * m, 3)
    return value_m.ravel(), np.block([[arm, offsets, none], [arm, none, offsets]])


@njit(cache=True)  # type: ignore[misc]  # numba has no types
def _likeliest(
    value_m: FloatArray, design: FloatArray, narrow: FloatArray, wide: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the unknowns and the probability of links to be bad, (l,), by 50 steps of EM."""
    worse = np.full(len(value_m) // 2, SHARE)
    x = np.zeros(design.shape[1])
    for _ in range(50):
        both = np.concatenate((worse, worse))
        weighted = design * ((1.0 - both) / narrow + both / wide).reshape(-1, 1)
        x = np.linalg.solve(weighted.T @ design, weighted.T @ value_m)
        worse = _links(value_m - design @ x, narrow, wide)[1]
    return x, worse


@njit(cache=True)  # type: ignore[misc]  # numba has no types
def _links(
    residual_m: FloatArray, narrow: FloatArray, wide: FloatArray
) -> tuple[float, FloatArray]:
    """Return the log density of all links, and the probability of each to be bad, (l,)."""
    good = -0.5 * (residual_m**2 / narrow + np.log(narrow))
    bad = -0.5 * (residual_m**2 / wide + np.log(wide))
    half = len(residual_m) // 2
    log_good = np.log(1.0 - SHARE) + good[:half] + good[half:]
    log_bad = np.log(SHARE) + bad[:half] + bad[half:]
    both = np.logaddexp(log_good, log_bad)
    return both.sum(), np.exp(log_bad - both)


@njit(cache=True)  # type: ignore[misc]  # numba has no types
def _integral(
    value_m: FloatArray,
    design: FloatArray,
    narrow: FloatArray,
    wide: FloatArray,
    worse: FloatArray,
    rng: np.random.Generator,
) -> float:
    """Return the log of the density of links, integrated over all unknowns."""
    u = design.shape[1]
    means, roots = np.zeros((GAUSSIANS, u)), np.zeros((GAUSSIANS, u, u))
    log_size = np.zeros(GAUSSIANS)
    for step in range(BURN_IN + GAUSSIANS * APART):
        bad = rng.random(len(worse)) < worse
        weighted = design / np.where(np.concatenate((bad, bad)), wide, narrow).reshape(-1, 1)
        normal = weighted.T @ design
        mean, root = np.linalg.solve(normal, weighted.T @ value_m), np.linalg.cholesky(normal)
        x = mean + np.linalg.solve(root.T, rng.standard_normal(u))
        worse = _links(value_m - design @ x, narrow, wide)[1]
        kept, rest = divmod(step - BURN_IN, APART)
        if kept >= 0 and rest == 0:
            means[kept], roots[kept] = mean, root
            log_size[kept] = np.log(np.diag(root)).sum()
    weights, proposed = np.zeros(DRAWS), np.zeros(GAUSSIANS)
    for i in range(DRAWS):
        own = i % GAUSSIANS
        x = means[own] + np.linalg.solve(roots[own].T, rng.standard_normal(u))
        for q in range(GAUSSIANS):
            proposed[q] = log_size[q] - 0.5 * np.sum((roots[q].T @ (x - means[q])) ** 2)
        top = proposed.max()
        log_proposal = top + np.log(np.exp(proposed - top).mean())
        weights[i] = _links(value_m - design @ x, narrow, wide)[0] - log_proposal
    top = weights.max()
    return top + np.log(np.exp(weights - top).mean())

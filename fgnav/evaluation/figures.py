"""Figures of one method on one flight, by name: statistics over flights rest on them."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.scores import EULER, Score, rms
from fgnav.types.estimate import Errors


class Figure(NamedTuple):
    """A figure of a method on a flight: where its score has it, its head in tables.

    With a title it is one by which methods are held against each other.
    """

    path: str = ""  # in ``Score``; empty where it is computed from the errors
    head: str = ""
    title: str = ""
    is_rms: bool = False


# Unit and meaning are in the name; NaN where a method or a flight has nothing to judge.
FIGURES = {
    "available": Figure("available", "epochs"),
    **{f"{angle}_rmse_deg": Figure(f"rmse_deg.{angle}", is_rms=True) for angle in EULER},
    "attitude_rmse_deg": Figure("attitude_rmse_deg", "attitude, deg RMS", is_rms=True),
    "attitude_median_deg": Figure("", "median, deg", "median attitude error, deg"),
    "attitude_p95_deg": Figure("", "95 %, deg", "95th percentile of attitude error, deg"),
    "matched_attitude_rmse_deg": Figure(
        "", "matched, deg RMS", "attitude RMS on common epochs, deg", is_rms=True
    ),
    "position_rmse_m": Figure("position_rmse_m", "position, m RMS", "position RMS, m", is_rms=True),
    "velocity_rmse_mps": Figure(
        "velocity_rmse_mps", "velocity, m/s RMS", "velocity RMS, m/s", is_rms=True
    ),
    "attitude_nees": Figure("attitude_nees_mean", "NEES, of 3"),
    "position_nees": Figure("position_nees_mean"),
    "velocity_nees": Figure("velocity_nees_mean"),
    "attitude_nll": Figure("", "NLL"),
    "attitude_energy_score_deg": Figure("", "energy, deg", "energy score of attitude, deg"),
    "integers_right": Figure("integers.right"),
    "integers_wrong": Figure("integers.wrong"),
    "integers_refused": Figure("integers.not_fixed"),
}
_NODES = 128  # of a normal distribution, a power of 2: energy scores to .3 %


def flight_figures(comparison: Comparison) -> dict[str, dict[str, float]]:
    """Return the figures of every method of a comparison, by method and name of ``FIGURES``.

    ``matched_attitude_rmse_deg`` counts only the epochs that all methods with an answer have: an
    easy way to a small error is to answer in easy epochs only.
    """
    matched = _matched(comparison.methods)
    return {
        method.name: _figures(method)
        | {"matched_attitude_rmse_deg": matched.get(method.name, np.nan)}
        for method in comparison.methods
    }


def _figures(method: Method) -> dict[str, float]:
    score, errors = method.score, method.errors
    figures = {name: _value(score, figure.path) for name, figure in FIGURES.items()}
    if errors is not None and score.attitude_rmse_deg is not None and len(errors.t_s):
        angle_deg = np.degrees(np.linalg.norm(errors.tangent_b_rad, axis=1))
        figures["attitude_median_deg"] = float(np.median(angle_deg))
        figures["attitude_p95_deg"] = float(np.percentile(angle_deg, 95))
        figures |= _proper_scores(method, errors)
    return figures


def _value(score: Score, path: str) -> float:
    """Return the value at a path of attributes of a score; NaN where there is none."""
    value: Any = score
    for name in path.split("."):
        value = getattr(value, name, None)
    return float("nan") if value is None else float(value)


def _proper_scores(method: Method, errors: Errors) -> dict[str, float]:
    """Return mean negative log-likelihood and energy score of the stated attitudes."""
    estimate = method.estimate
    if estimate is None or estimate.attitude_covariance_rad2 is None:
        return {}
    rows = common_epochs(estimate.t_s, errors.t_s)[0]
    covariance = estimate.attitude_covariance_rad2[rows]
    return {
        "attitude_nll": negative_log_likelihood(errors.tangent_b_rad, covariance),
        "attitude_energy_score_deg": float(
            np.degrees(energy_score(errors.tangent_b_rad, covariance))
        ),
    }


def negative_log_likelihood(error: FloatArray, covariance: FloatArray) -> float:
    """Return the mean negative log-likelihood of errors under normal distributions.

    Parameters
    ----------
    error : ndarray, shape (n, d)
    covariance : ndarray, shape (n, d, d)

    Returns
    -------
    float
        NaN where a covariance is not positive definite.
    """
    variance, axes = np.linalg.eigh(covariance)
    if not len(error) or (variance <= 0).any():
        return float("nan")
    along = np.einsum("nij,ni->nj", axes, error)
    terms = along**2 / variance + np.log(2 * np.pi * variance)
    return float(terms.sum(axis=1).mean() / 2)


def energy_score(error: FloatArray, covariance: FloatArray) -> float:
    """Return the mean energy score of normal distributions, in the errors' unit.

    ``E|X - y| - E|X - X'| / 2``, strictly proper [1]_: the lower the better, and lowest in the
    mean for the right covariance. Expectations by a fixed set of quasi-random nodes.

    Parameters
    ----------
    error : ndarray, shape (n, d)
        What came out less the mean that was stated.
    covariance : ndarray, shape (n, d, d)

    Returns
    -------
    float
        NaN where a covariance is not positive semidefinite.

    References
    ----------
    .. [1] Gneiting, Raftery: Strictly proper scoring rules, prediction, and estimation, JASA 102,
       2007, section 4.3.
    """
    variance, axes = np.linalg.eigh(covariance)
    if not len(error) or (variance < 0).any():
        return float("nan")
    root = axes * np.sqrt(variance)[:, None, :]
    draws = np.einsum("nij,mj->nmi", root, normal_nodes(error.shape[1]))
    near = np.linalg.norm(draws - error[:, None], axis=2).mean(axis=1)
    # X - X' is normal with twice the covariance.
    spread = np.sqrt(2) * np.linalg.norm(draws, axis=2).mean(axis=1)
    return float((near - spread / 2).mean())


def normal_nodes(d: int) -> FloatArray:
    """Return nodes of a standard normal distribution of d dimensions, (m, d), mean zero."""
    from scipy.stats import norm, qmc  # noqa: PLC0415  # lazy: 0.5 s

    half_nodes = _NODES // 2
    corners = qmc.Sobol(d, scramble=False).random_base2(half_nodes.bit_length() - 1)
    half = norm.ppf(corners + 0.5 / half_nodes)  # in the middle of their cells: none at 0
    return np.concatenate([half, -half])


def _matched(methods: Sequence[Method]) -> dict[str, float]:
    """Return each method's RMSE over the epochs that all methods with an answer have, degrees."""
    of = {
        m.name: m.errors
        for m in methods
        if m.errors is not None and m.score.attitude_rmse_deg is not None and len(m.errors.t_s)
    }
    if not of:
        return {}
    shared = next(iter(of.values())).t_s
    for errors in of.values():
        shared = shared[common_epochs(shared, errors.t_s)[0]]
    if not len(shared):
        return {}
    rows = {name: common_epochs(errors.t_s, shared)[0] for name, errors in of.items()}
    matched = {name: rms(errors.tangent_b_rad[rows[name]]) for name, errors in of.items()}
    return {name: float(np.degrees(value)) for name, value in matched.items() if value is not None}

"""Networks judged by what a smoother makes of their answers on flights they never saw, in pairs."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.evaluation.paired import Interval, pooled
from fgnav.geometry.rotations import log, transpose
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.methods.smoother import Smoother
from fgnav.types.flight import Flight
from fgnav_models.training.release import markdown_table

_DRAWS = 64  # pairs of each keyframe's energy score: 1 % of a flight's of 300
FIGURES = ("attitude NLL", "attitude energy score, deg", "attitude RMSE, deg", "attitude NEES of 3")


class Judgement(NamedTuple):
    """Of one method on flights, (n,) each, NaN where it has no solution; as ``FIGURES``."""

    nll: FloatArray
    energy_deg: FloatArray
    rmse_deg: FloatArray
    nees: FloatArray


class Compared(NamedTuple):
    """A figure of two methods on the flights that both solve: means, and their difference."""

    figure: str
    flights: int
    first: float
    second: float
    difference: Interval  # second less first: below zero the second is better, but for NEES


def judged(method: Smoother, flights: Sequence[Flight]) -> Judgement:
    """Return a method's figures on flights with truth."""
    return Judgement._make(np.array([_figures(method, flight) for flight in flights]).T)


def compared(first: Judgement, second: Judgement, rng: np.random.Generator) -> tuple[Compared, ...]:
    """Return figures beside each other, with intervals of 95 % by flight."""
    out = []
    for name, a, b in zip(FIGURES, first, second, strict=True):
        both = np.isfinite(a) & np.isfinite(b)
        means = float(a[both].mean()), float(b[both].mean())
        difference = pooled(b[both] - a[both], rng, squared=False)
        out.append(Compared(name, int(both.sum()), *means, difference))
    return tuple(out)


def report_rows(name: str, found: Sequence[Compared]) -> list[list[str]]:
    """Return lines of a training report: what, on what, figure, value."""
    return [
        [
            f"{name} through the smoother",
            f"{one.flights} held-out flights",
            one.figure,
            f"{one.second:.4g}, alone {one.first:.4g}, difference {_words(one.difference)}",
        ]
        for one in found
    ]


def text(found: Sequence[Compared]) -> str:
    """Return both networks beside each other, and whether the second is better, for a card."""
    heads = ("on held-out flights", "trained alone", "through the smoother", "difference (95 %)")
    rows = [
        (one.figure, f"{one.first:.4g}", f"{one.second:.4g}", _words(one.difference))
        for one in found
    ]
    better = [one.figure for one in found[:2] if one.difference.high < 0]  # NLL, energy score
    verdict = f"Better by {' and '.join(better)}." if better else "No better than trained alone."
    flights = f"{found[0].flights} flights that both solve, in pairs. {verdict}"
    return f"{flights}\n\n{markdown_table(heads, rows)}"


def _words(one: Interval) -> str:
    return f"{one.value:+.3g} ({one.low:+.3g} to {one.high:+.3g})"


def _figures(method: Smoother, flight: Flight) -> tuple[float, float, float, float]:
    try:
        estimate = method(flight)
    except NoSolutionError:
        return (np.nan,) * 4
    P, truth = estimate.attitude_covariance_rad2, flight.truth
    if P is None or truth is None or not estimate.converged:
        return (np.nan,) * 4
    R_nb, covered = attitude_at(truth, estimate.t_s)
    error_rad, P = log(transpose(estimate.R_nb) @ R_nb)[covered], P[covered]
    L = np.linalg.cholesky(P)
    squared = (np.linalg.solve(L, error_rad[:, :, None]) ** 2).sum(axis=(1, 2))
    log_det = 2 * np.log(np.einsum("nii->ni", L)).sum(axis=1)
    draws = np.random.default_rng(0).standard_normal((2, _DRAWS, len(L), 3))  # common to methods
    x_rad, y_rad = np.einsum("nij,pdnj->pdni", L, draws)
    far_rad = np.linalg.norm(x_rad - error_rad, axis=2).mean()
    apart_rad = np.linalg.norm(x_rad - y_rad, axis=2).mean()
    return (
        float((squared + log_det + 3 * np.log(2 * np.pi)).mean() / 2),
        float(np.degrees(far_rad - apart_rad / 2)),
        float(np.degrees(np.sqrt((error_rad**2).sum(axis=1).mean()))),
        float(squared.mean()),
    )

"""Figures of a velocity network on held-out flights: its answers, and states in outages."""

import csv
from collections.abc import Mapping, Sequence
from io import StringIO
from typing import NamedTuple

import numpy as np
import torch

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.evaluation.figures import energy_score, negative_log_likelihood
from fgnav.evaluation.networks import calibration
from fgnav.evaluation.paired import paired, pooled
from fgnav.neural.factor import NeuralFactor
from fgnav.types.flight import Flight
from fgnav_models.learn.scores import Scored, errors
from fgnav_models.training.velocity.outages import OutageFlight

_UNITS: dict[Scored, tuple[str, float]] = {
    "attitude": ("deg", 180 / np.pi),
    "position": ("m", 1.0),
    "velocity": ("m/s", 1.0),
}
_SEED = 0x5EED  # of the bootstrap
Factors = tuple[NeuralFactor, ...]


class Scores(NamedTuple):
    """Figures of one state in the outage of one flight."""

    rmse: float
    nees: float  # of one degree of freedom
    nll: float
    energy: float


def answer_figures(source: NeuralFactor, flights: Sequence[Flight]) -> dict[str, float]:
    """Return RMSE, NEES of 1, NLL and energy score of answers, by kind of vehicle.

    Beside them are those by the best constant standard deviations of the kind's other flights,
    which takes two of a kind.
    """
    figures: dict[str, float] = {}
    for kind in ("all", *dict.fromkeys(flight.name for flight in flights)):
        of_kind = [flight for flight in flights if kind in ("all", flight.name)]
        if len(of_kind) < 2:
            continue
        answers = calibration([source] * len(of_kind), of_kind)
        figures[f"{kind}: RMSE m/s"] = answers.rmse
        for name, scores in (("network", answers.network), ("best constant", answers.constant)):
            figures[f"{kind}: NEES of 1, {name}"] = scores.nees
            figures[f"{kind}: NLL, {name}"] = scores.nll
            figures[f"{kind}: energy score m/s, {name}"] = scores.energy
    return figures


def outage_scores(
    methods: Mapping[str, Factors], flights: Sequence[OutageFlight]
) -> dict[tuple[str, Scored], FloatArray]:
    """Return ``Scores``, (flights, 4), of each method's factors in the smoother, by state.

    NaN where there is no solution.
    """
    collected: dict[tuple[str, Scored], list[Scores]] = {}
    for method, factors in methods.items():
        for flight in flights:
            for state, scores in _scores(flight, factors).items():
                collected.setdefault((method, state), []).append(scores)
    return {key: np.array(scores) for key, scores in collected.items()}


def _scores(flight: OutageFlight, factors: Factors) -> dict[Scored, Scores]:
    try:
        with torch.no_grad():
            posterior = flight.posterior(factors)
    except NoSolutionError:
        return dict.fromkeys(_UNITS, Scores(*np.full(4, np.nan).tolist()))
    by_state: dict[Scored, Scores] = {}
    for state, (_, scale) in _UNITS.items():
        error, covariance = (x.numpy() for x in errors(posterior, flight.outage, (state,)))
        squares = np.einsum(
            "ni,ni->n", error, np.linalg.solve(covariance, error[:, :, None])[:, :, 0]
        )
        by_state[state] = Scores(
            rmse=scale * float(np.sqrt((error**2).sum(axis=1).mean())),
            nees=float(squares.mean()) / 3,
            nll=negative_log_likelihood(error, covariance),
            energy=scale * energy_score(error, covariance),
        )
    return by_state


def outage_table(scores: Mapping[tuple[str, Scored], FloatArray]) -> str:
    """Return a CSV table: figures of each method and state, and by how much the last is better.

    Differences are of the last method less the row's, over flights that both solve, with their
    intervals of 95 %.
    """
    file = StringIO()
    writer = csv.writer(file, lineterminator="\n")
    heads = [
        f"{name}{bound}" for name in Scores._fields for bound in ("", "_less", "_low", "_high")
    ]
    writer.writerow(["method", "state", "unit", "flights", *heads])
    last = list(scores)[-1][0]
    for (method, state), rows in scores.items():
        cells = [method, state, _UNITS[state][0], str(int(np.isfinite(rows[:, 0]).sum()))]
        for column, best, name in zip(rows.T, scores[last, state].T, Scores._fields, strict=True):
            rng = np.random.default_rng(_SEED)
            cells.append(f"{pooled(column, rng, squared=name == 'rmse').value:.4g}")
            gain = paired(best, column, rng).difference
            bounds = (gain.value, gain.low, gain.high)
            cells += [f"{x:.4g}" if method != last else "" for x in bounds]
        writer.writerow(cells)
    return file.getvalue()

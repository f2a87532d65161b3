"""How right a network's covariance is, compared with the best constant standard deviations.

Errors e and covariances P of all answers on flights with truth, in the output's tangent:

- NEES: the mean of ``e' P^-1 e``, here divided by the tangent's freedom;
- NLL: the mean of ``(e' P^-1 e + log det 2 pi P) / 2``;
- energy score: ``evaluation.figures``.

The constant is what the manifest's form ``none`` could state: a standard deviation of each axis of
the tangent, of directions one for both. That of maximum likelihood is the RMS of the errors, here
of the answers of all other flights: leave one out. No flight is judged by a constant it is part of.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.evaluation.figures import energy_score, negative_log_likelihood
from fgnav.evaluation.paired import Interval, pooled
from fgnav.evaluation.reference import covered, truth_at
from fgnav.geometry.rotations import log, to_euler, transpose, wrap
from fgnav.graph.correlation import interval_s
from fgnav.neural.correlation import half_life_s, lasting_share, together
from fgnav.neural.factor import NeuralFactor
from fgnav.neural.manifest import Output
from fgnav.types.flight import Flight, Truth

_EVERY_S = 0.1  # between answers, or more where sensors are slower: closer ones err alike
_NOTHING = 1e-9  # of a variance: rounding
_BINS = 5  # by predicted sigma, equally many answers in each
_SEED = 0x5EED  # of the bootstrap


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """NEES per degree of freedom, NLL and energy score of one covariance."""

    nees: float
    nll: float
    energy: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Bin:
    """Answers of about one predicted sigma, that and the root mean square of their errors."""

    count: int
    predicted: float
    rms: float
    nees: float


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Calibration:
    """The figures of a network's answers, in SI and radians.

    Attributes
    ----------
    count, outside : int
        Answers, and windows without one: outside of the domain, or with gaps.
    rmse : float
        Root mean square of the length of the error.
    network, constant : Scores
        By the network's covariance, and by the constant one of the other flights.
    gain : Interval
        Mean over flights of the NLL by the network's covariance less that by the constant.
    sigmas : tuple of tuple of float
        The constant standard deviations of each flight, in the tangent, fitted to the others.
    half_life_s, lasting : float
        Of normalised errors: the share of their variance that is constant over a flight, and the
        half-life of the rest.
    together : (float, float)
        NEES of 1 of the mean of each flight's answers: as the manifest has them counted, and as if
        all were independent.
    bins : tuple of Bin
        Reliability, by predicted sigma.
    """

    name: str
    unit: str
    count: int
    outside: int
    rmse: float
    network: Scores
    constant: Scores
    gain: Interval
    sigmas: tuple[tuple[float, ...], ...]
    half_life_s: float
    lasting: float
    together: tuple[float, float]
    bins: tuple[Bin, ...]

    @property
    def answered(self) -> float:
        """Share of the windows with an answer."""
        return self.count / (self.count + self.outside)


class _Errors(NamedTuple):
    """Errors of a flight's answers, (k, f), in the output's tangent; directions in north and east.

    ``normalised``, (k, d), are those by their standard deviations, for the correlation.
    """

    t_s: FloatArray
    error: FloatArray
    covariance: FloatArray
    normalised: FloatArray
    outside: int


def calibration(factors: Sequence[NeuralFactor], flights: Sequence[Flight]) -> Calibration:
    """Return a network's figures on flights with truth.

    Parameters
    ----------
    factors : sequence of NeuralFactor
        The same network for each flight, with the records of that flight.
    flights : sequence of Flight
        Two or more, none of which it was trained on.

    Raises
    ------
    BadInputError
        If a flight has no truth or lacks a sensor, or fewer than two have answers.
    """
    network = factors[0].network
    output = network.manifest.output
    errors = [_errors(*one) for one in zip(factors, flights, strict=True)]
    white = [(one.t_s, one.normalised) for one in errors if len(one.t_s) > 2]
    if len(white) < 2:
        raise BadInputError(
            f"{network.path}: {len(white)} of {len(flights)} flights have three answers or more; "
            "give two that have, as a flight's constant sigma is fitted to the others"
        )
    sigmas = _sigmas(errors, alike=output.measures == "direction")
    constants = [
        np.broadcast_to(np.eye(one.error.shape[1]) * sigma**2, one.covariance.shape)
        for one, sigma in zip(errors, sigmas, strict=True)
    ]
    e, P = (np.concatenate([getattr(one, name) for one in errors]) for name in _Errors._fields[1:3])
    gains = [
        negative_log_likelihood(one.error, one.covariance)
        - negative_log_likelihood(one.error, constant)
        for one, constant in zip(errors, constants, strict=True)
    ]
    axes, lasting = 2 if output.measures == "direction" else None, lasting_share(white)
    interval = interval_s(output.half_life_s)
    return Calibration(
        name=network.manifest.name,
        unit="rad" if output.unit == "deg" else output.unit,
        count=len(e),
        outside=sum(one.outside for one in errors),
        rmse=float(np.sqrt((e**2).sum() / len(e))),
        network=_scores(e, P),
        constant=_scores(e, np.concatenate(constants)),
        gain=pooled(np.array(gains), np.random.default_rng(_SEED), squared=False),
        sigmas=tuple(tuple(one[: 1 if axes else None].tolist()) for one in sigmas),
        half_life_s=half_life_s(white, lasting, axes=axes),
        lasting=lasting,
        together=(
            together(white, output.half_life_s, interval, output.lasting),
            together(white, 0.0, 0.0),
        ),
        bins=_bins(e, P),
    )


def _sigmas(errors: Sequence[_Errors], *, alike: bool) -> FloatArray:
    """Return the RMS of all other flights' errors, (flights, f); alike, one for all axes."""
    squares = np.array([(one.error**2).sum(axis=0) for one in errors])
    counts = np.array([len(one.error) for one in errors])[:, None]
    variance = (squares.sum(axis=0) - squares) / (counts.sum() - counts)
    if alike:
        variance = np.repeat(variance.mean(axis=1, keepdims=True), variance.shape[1], axis=1)
    return np.asarray(np.sqrt(variance))


def _errors(factor: NeuralFactor, flight: Flight) -> _Errors:
    truth, manifest = flight.truth, factor.network.manifest
    if truth is None:
        raise BadInputError(f"flight {flight.name}: has no truth to judge a network by")
    records = factor.records_of(flight)
    slowest = int(np.argmin([len(record.t_s) for record in records]))
    spans_s = [one.window / one.rate_hz for one in manifest.inputs]
    t_s = records[slowest].t_s[covered(truth, records[slowest].t_s)]
    t_s = t_s[t_s >= t_s[:1] + max(*spans_s, manifest.output.over_s or 0.0)]
    t_s = t_s[:: max(1, round(_EVERY_S * manifest.inputs[slowest].rate_hz))]
    inside, answers, _ = factor.answers(flight, t_s)
    answered_s, value, covariance = t_s[inside], answers.value, answers.covariance
    real = truth_at(truth, answered_s)
    error = _against_truth(manifest.output, truth, real, value)
    across = np.eye(error.shape[1])
    if manifest.output.measures == "direction":
        across = across - value[:, :, None] * value[:, None, :]
    normalised = _in_tangent(error, across @ covariance @ across)
    if manifest.output.measures == "direction":
        level = real.R_nb[:, :2]  # north and east: axes that do not rotate
        error = np.einsum("kij,kj->ki", level, error)
        covariance = level @ covariance @ level.swapaxes(1, 2)
    return _Errors(answered_s, error, covariance, normalised, len(t_s) - len(answered_s))


def _against_truth(output: Output, truth: Truth, real: Truth, value: FloatArray) -> FloatArray:
    """Return errors of answers, (k, f), in the tangent; points are the body's origin."""
    match output.measures:
        case "heading":
            return np.asarray(wrap(value - to_euler(real.R_nb)[:, 2:]))
        case "attitude":
            return np.asarray(log(transpose(value.reshape(-1, 3, 3)) @ real.R_nb))
        case "direction":
            return np.asarray(value - real.R_nb[:, 2])
        case "height":
            return np.asarray(value + real.p_n_m[:, 2:])
        case "position":
            return np.asarray(value - real.p_n_m)
        case "speed":
            return np.asarray(value - np.linalg.norm(real.v_n_mps, axis=1, keepdims=True))
        case "velocity":
            R_nb, true_n = real.R_nb, real.v_n_mps
        case _:
            begin = truth_at(truth, real.t_s - (output.over_s or 0.0))
            R_nb, true_n = begin.R_nb, real.p_n_m - begin.p_n_m
    true = np.einsum("kji,kj->ki", R_nb, true_n) if output.frame == "b" else true_n
    return np.asarray(value - true)


def _in_tangent(e: FloatArray, P: FloatArray) -> FloatArray:
    """Return errors by the symmetric root of covariances, which may have no rank along one axis.

    Along that there is no error; the others are scaled so that all together have a NEES of 1.
    """
    values, axes = np.linalg.eigh(P)
    present = values > _NOTHING * values[:, -1:]
    by_axis = np.einsum("kji,kj->ki", axes, e) / np.sqrt(np.where(present, values, 1.0)) * present
    scale = np.sqrt(e.shape[1] / present.sum(axis=1))[:, None]
    return np.asarray(scale * np.einsum("kij,kj->ki", axes, by_axis))


def _nees(e: FloatArray, P: FloatArray) -> FloatArray:
    """Return NEES per degree of freedom of each answer, (k,)."""
    return np.asarray((e * np.linalg.solve(P, e[:, :, None])[:, :, 0]).mean(axis=1))


def _scores(e: FloatArray, P: FloatArray) -> Scores:
    return Scores(
        nees=float(_nees(e, P).mean()),
        nll=negative_log_likelihood(e, P),
        energy=energy_score(e, P),
    )


def _bins(e: FloatArray, P: FloatArray) -> tuple[Bin, ...]:
    f = e.shape[1]
    sigma, nees = np.sqrt(np.einsum("kii->k", P) / f), _nees(e, P)
    return tuple(
        Bin(
            count=len(rows),
            predicted=float(np.sqrt((sigma[rows] ** 2).mean())),
            rms=float(np.sqrt((e[rows] ** 2).mean())),
            nees=float(nees[rows].mean()),
        )
        for rows in np.array_split(np.argsort(sigma), _BINS)
        if len(rows)
    )

"""How honest a network's covariance is, beside the constant one that the likelihood fits.

Errors e and covariances P of all answers on flights whose truth is known, in the output's tangent:

- NEES: the mean of ``e' P^-1 e``, which is f, the tangent's freedom, if P is right;
- NLL: the mean of ``(e' P^-1 e + log det 2 pi P) / 2``;
- energy score: the mean of ``E|x - e| - E|x - x'| / 2`` of x, x' drawn from N(0, P) [1]_.

The constant covariance is the mean of ``e e'``, which maximises the likelihood of the same flights:
a network that is no better has learned nothing about its own errors.

References
----------
.. [1] Gneiting, Raftery: Strictly proper scoring rules, prediction, and estimation, JASA 102, 2007,
   equation 22.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import log, to_euler, transpose, wrap
from fgnav.graph.correlation import interval_s
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.neural.correlation import Errors, half_life_s, lasting_share, together
from fgnav.neural.measures import SENSORS
from fgnav.neural.network import Network, load_network
from fgnav.neural.records import Record, check_rate, of_flight
from fgnav.neural.windows import windows
from fgnav.types.flight import Flight, Truth

_DRAWS = 64  # pairs of each answer's energy score: 0.1 % of the mean of ten thousand answers
_EVERY_S = 0.1  # between answers, or more where sensors are slower: closer ones say the same
_NOTHING = 1e-9  # of a variance: rounding
_BINS = 5  # by predicted sigma, equally many answers in each
_JUDGED = ("heading", "attitude", "direction", "velocity", "speed", "height")


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
    """The figures of a network's card, in SI and radians."""

    name: str
    unit: str
    # count, outside: answers judged, and windows without an answer, outside of the domain or with
    # gaps
    count: int
    outside: int
    # network, constant: by the network's covariance, and by the constant one of these answers
    network: Scores
    constant: Scores
    constant_sigma: tuple[float, ...]  # of each axis of the tangent
    # half_life_s, lasting: of normalised errors, measured on these flights: the share of their
    # variance that lasts, and the half-life of the rest
    half_life_s: float
    lasting: float
    # NEES of 1 of the mean of each flight's answers: as the manifest has them counted, and as if
    # all were independent
    together: tuple[float, float]
    bins: tuple[Bin, ...]

    def __str__(self) -> str:
        """Return the card's table."""
        scale, unit = (180 / np.pi, "deg") if self.unit == "rad" else (1.0, self.unit)
        sigma = ", ".join(f"{scale * s:.3g}" for s in self.constant_sigma)
        lines = [
            f"{self.name}: {self.count} answers, {self.outside} windows outside the domain or "
            f"with gaps; {self.lasting:.0%} of the errors' variance lasts, half-life of the rest "
            f"{self.half_life_s:.3g} s",
            f"{'covariance':24} {'NEES of 1':>10} {'NLL':>10} {f'energy {unit}':>12}",
        ]
        for what, one in (
            ("of the network", self.network),
            (f"constant, {sigma} {unit}", self.constant),
        ):
            lines.append(f"{what:24} {one.nees:10.2f} {one.nll:10.3f} {scale * one.energy:12.4g}")
        if self.network.nll >= self.constant.nll:
            lines.append("The network's sigma is no better than a constant one.")
        lines.append(
            f"a flight's answers together: NEES of 1 {self.together[0]:.2f} as the factor counts "
            f"them, {self.together[1]:.3g} if they were independent"
        )
        lines.append(
            f"{'predicted ' + unit:>16} {'rms ' + unit:>12} {'NEES of 1':>10} {'count':>7}"
        )
        lines += [
            f"{scale * b.predicted:16.4g} {scale * b.rms:12.4g} {b.nees:10.2f} {b.count:7}"
            for b in self.bins
        ]
        return "\n".join(lines)


def calibration(
    manifest: Path | str | Network, flights: Iterable[tuple[Flight, Mapping[str, Record]]]
) -> Calibration:
    """Return a network's figures on flights with truth.

    Parameters
    ----------
    manifest : Path, str or Network
    flights : iterable of (Flight, mapping of str to Record)
        Never trained on; records as of ``NeuralFactor``.

    Raises
    ------
    BadInputError
        If a flight has no truth or lacks a sensor, nothing is answered, or the quantity is not
        one of a single time.
    """
    network = manifest if isinstance(manifest, Network) else load_network(Path(manifest))
    errors, covariances, outside = [], [], 0
    white: list[Errors] = []
    output = network.manifest.output
    if output.measures not in _JUDGED:
        raise BadInputError(
            f"{network.path}: key output.measures: calibration judges {', '.join(_JUDGED)}, got "
            f"{output.measures}"
        )
    for flight, records in flights:
        t_s, error, covariance, normalised, lost = _errors(network, flight, records)
        errors.append(error)
        covariances.append(covariance)
        outside += lost
        if len(t_s) > 2:
            white.append((t_s, normalised))
    if not white:
        raise BadInputError(f"{network.path}: the flights have no three windows to answer")
    e, P = np.concatenate(errors), np.concatenate(covariances)
    constant, stated_s = e.T @ e / len(e), output.half_life_s
    lasting = lasting_share(white)
    return Calibration(
        name=network.manifest.name,
        unit="rad" if output.unit == "deg" else output.unit,
        count=len(e),
        outside=outside,
        network=_scores(e, P),
        constant=_scores(e, np.broadcast_to(constant, P.shape)),
        constant_sigma=tuple(np.sqrt(np.diag(constant)).tolist()),
        half_life_s=half_life_s(white, lasting, axes=2 if output.measures == "direction" else None),
        lasting=lasting,
        together=(
            together(white, stated_s, interval_s(stated_s), output.lasting),
            together(white, 0.0, 0.0),
        ),
        bins=_bins(e, P),
    )


def _errors(
    network: Network, flight: Flight, records: Mapping[str, Record]
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int]:
    """Return times, errors and covariances, normalised errors, and how many have no answer."""
    truth = flight.truth
    if truth is None:
        raise BadInputError(f"flight {flight.name}: calibration needs its truth")
    have, seen = {**of_flight(flight), **records}, []
    for row, one in enumerate(network.manifest.inputs):
        where = f"{network.path}: key inputs[{row}]"
        if one.sensor not in have:
            raise BadInputError(
                f"{where}.sensor: flight {flight.name} has no {one.sensor!r}; known are "
                f"{', '.join(SENSORS)}, or give a record"
            )
        check_rate(where, have[one.sensor], one.rate_hz)
        seen.append(have[one.sensor])
    slowest = min(seen, key=lambda record: len(record.t_s))
    longest_s = max(one.window / one.rate_hz for one in network.manifest.inputs)
    inside = (slowest.t_s >= max(truth.t_s[0], slowest.t_s[0] + longest_s)) & (
        slowest.t_s <= truth.t_s[-1]
    )
    rate_hz = max(one.rate_hz for one in network.manifest.inputs if have[one.sensor] is slowest)
    t_s = slowest.t_s[inside][:: max(1, round(_EVERY_S * rate_hz))]
    shown = windows(network.manifest.inputs, seen, t_s)
    answers = network([x[shown.usable] for x in shown.inputs])
    within = np.ones(int(shown.usable.sum()), dtype=np.bool_)
    for statistic, figure in zip(network.manifest.domain, answers.figures, strict=True):
        within &= statistic.holds(figure)
    answered_s, value = t_s[shown.usable][within], answers.value[within]
    error = _against_truth(network, truth, answered_s, value)
    covariance = answers.covariance[within]
    across = np.eye(error.shape[1])
    if network.manifest.output.measures == "direction":
        across = across - value[:, :, None] * value[:, None, :]
    normalised = _in_tangent(error, across @ covariance @ across)
    if network.manifest.output.measures == "direction":
        level = attitude_at(truth, answered_s)[0][:, :2]  # north and east: axes that do not turn
        error = np.einsum("kij,kj->ki", level, error)
        covariance = level @ covariance @ level.swapaxes(1, 2)
    return answered_s, error, covariance, normalised, len(t_s) - len(answered_s)


def _against_truth(
    network: Network, truth: Truth, t_s: FloatArray, value: FloatArray
) -> FloatArray:
    """Return errors of answers, (k, f); of points the truth's own, the body's origin."""
    measures, frame = network.manifest.output.measures, network.manifest.output.frame
    R_nb = attitude_at(truth, t_s)[0]
    if measures == "heading":
        return np.asarray(wrap(value - to_euler(R_nb)[:, 2:]))
    if measures == "attitude":
        return np.asarray(log(transpose(value.reshape(-1, 3, 3)) @ R_nb))
    if measures == "direction":
        return np.asarray(value - R_nb[:, 2])
    if measures == "height":
        return np.asarray(value + np.interp(t_s, truth.t_s, truth.p_n_m[:, 2])[:, None])
    v_mps = interpolate(t_s, truth.t_s, truth.v_n_mps)
    if measures == "speed":
        return np.asarray(value - np.linalg.norm(v_mps, axis=1, keepdims=True))
    return np.asarray(value - (np.einsum("kji,kj->ki", R_nb, v_mps) if frame == "b" else v_mps))


def _normalised(e: FloatArray, P: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.solve(np.linalg.cholesky(P), e[:, :, None])[:, :, 0])


def _in_tangent(e: FloatArray, P: FloatArray) -> FloatArray:
    """Return errors by the symmetric root of covariances, which may have no rank along one axis.

    Along that there is no error; the others are scaled so that all together have a NEES of 1.
    """
    values, axes = np.linalg.eigh(P)
    present = values > _NOTHING * values[:, -1:]
    by_axis = np.einsum("kji,kj->ki", axes, e) / np.sqrt(np.where(present, values, 1.0)) * present
    scale = np.sqrt(e.shape[1] / present.sum(axis=1))[:, None]
    return np.asarray(scale * np.einsum("kij,kj->ki", axes, by_axis))


def _scores(e: FloatArray, P: FloatArray) -> Scores:
    L, f = np.linalg.cholesky(P), e.shape[1]
    squared = (_normalised(e, P) ** 2).sum(axis=1)
    log_det = 2 * np.log(np.einsum("kii->ki", L)).sum(axis=1)
    rng = np.random.default_rng(0)  # common draws: two covariances differ by themselves alone
    x = np.einsum("kij,dj->dki", L, rng.standard_normal((_DRAWS, f)))
    y = np.einsum("kij,dj->dki", L, rng.standard_normal((_DRAWS, f)))
    far = np.linalg.norm(x - e, axis=2).mean(), np.linalg.norm(x - y, axis=2).mean()
    return Scores(
        nees=float(squared.mean() / f),
        nll=float((squared + log_det + f * np.log(2 * np.pi)).mean() / 2),
        energy=float(far[0] - far[1] / 2),
    )


def _bins(e: FloatArray, P: FloatArray) -> tuple[Bin, ...]:
    f = e.shape[1]
    sigma, squared = np.sqrt(np.einsum("kii->k", P) / f), (_normalised(e, P) ** 2).mean(axis=1)
    parts = np.array_split(np.argsort(sigma), _BINS)
    return tuple(
        Bin(
            count=len(rows),
            predicted=float(np.sqrt((sigma[rows] ** 2).mean())),
            rms=float(np.sqrt((e[rows] ** 2).mean())),
            nees=float(squared[rows].mean()),
        )
        for rows in parts
        if len(rows)
    )

"""How good a velocity network is on flights it never saw, beside the constant sigma."""

from dataclasses import dataclass

import numpy as np
import torch

from fgnav.checks import FloatArray, IntArray
from fgnav.neural.correlation import half_life_s
from fgnav_models.training.velocity.data import Records
from fgnav_models.training.velocity.nets import VelocityNet
from fgnav_models.training.velocity.vehicles.world import KINDS

_EVERY_S = 0.1  # between windows that are judged
_AT_ONCE = 2000  # windows: 10 MB of six channels over four seconds
_AXES = ("forward", "right", "down")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Judged:
    """Errors and 1-sigmas of windows, (k, 3), m/s, of one flight after another.

    ``flight`` and ``kind`` say of which, (k,); ``prior`` is what a constant answer errs by.
    """

    flight: IntArray
    kind: IntArray
    error_mps: FloatArray
    sigma_mps: FloatArray
    prior_mps: FloatArray


def judged(net: VelocityNet, flights: Records, window: int) -> Judged:
    """Return a network's errors on flights, ten windows a second."""
    flight, last = flights.every(round(_EVERY_S * flights.rate_hz), window)
    errors, sigmas, truth = [], [], []
    with torch.no_grad():
        for first in range(0, len(flight), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            *sensed, v_b_mps = flights.windows(flight[part], last[part], window)
            answer, log_sigma = net(*sensed)
            errors.append((answer - v_b_mps).double().numpy())
            sigmas.append(log_sigma.double().exp().numpy())
            truth.append(v_b_mps.double().numpy())
    v = np.concatenate(truth)
    return Judged(
        flight=flight,
        kind=flights.kind[flight],
        error_mps=np.concatenate(errors),
        sigma_mps=np.concatenate(sigmas),
        prior_mps=v - v.mean(axis=0),
    )


def measured_half_life_s(of: Judged) -> float:
    """Return the half-life of errors, normalised by their 1-sigmas."""
    white = of.error_mps / of.sigma_mps
    flights = [white[of.flight == k] for k in np.unique(of.flight)]
    return half_life_s([(_EVERY_S * np.arange(len(one)), one) for one in flights])


def figures_of(of: Judged) -> dict[str, float]:
    """Return RMS errors, NEES of 1 and likelihoods by axis and kind of vehicle."""
    found: dict[str, float] = {}
    for axis, name in enumerate(_AXES):
        e, sigma, prior = of.error_mps[:, axis], of.sigma_mps[:, axis], of.prior_mps[:, axis]
        constant = np.sqrt((e**2).mean())
        found |= {
            f"{name}: network, RMS m/s": float(constant),
            f"{name}: no network, RMS m/s": float(np.sqrt((prior**2).mean())),
            f"{name}: NLL by the network's sigma": _nll(e, sigma),
            f"{name}: NLL by the constant sigma that fits best": _nll(e, constant),
        }
        for k, kind in enumerate(KINDS):
            own = of.kind == k
            if own.any():
                found[f"{kind}, {name}: RMS m/s"] = float(np.sqrt((e[own] ** 2).mean()))
                found[f"{kind}, {name}: NEES of 1"] = float(((e / sigma)[own] ** 2).mean())
    return found


def _nll(error: FloatArray, sigma: FloatArray | float) -> float:
    squared = (error / sigma) ** 2
    return float((squared / 2 + np.log(sigma) + np.log(2 * np.pi) / 2).mean())

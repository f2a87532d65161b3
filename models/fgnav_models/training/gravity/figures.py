"""How good a gravity network is, and how soon its errors are new ones."""

import msgspec
import numpy as np
import torch

from fgnav.checks import FloatArray
from fgnav_models.training.gravity.data import BASELINES, Rows, angles_deg, baseline, draw, rms
from fgnav_models.training.gravity.nets import GravityNet, deviation
from fgnav_sim.data_sets.gravity import GravityEpochs
from fgnav_sim.data_sets.gravity_motions import PHASES
from fgnav_sim.data_sets.gravity_world import GravityWorld

_SPAN_S, _EACH = 20.0, 200  # to tell how errors of one flight hang together
_WITHIN = 5.991  # 95 % quantile of chi-square with two degrees of freedom


def figures_of(net: GravityNet, epochs: GravityEpochs) -> dict[str, float]:
    """Return RMS errors, degrees, of network and baselines, and the network's consistency.

    NEES is the mean normalised estimation error squared, 2 of an honest covariance.
    """
    rows = Rows.of(epochs)
    with torch.no_grad():
        g_b, covariance = net(*rows.seen(aided=net.aided))
        _, squared, _ = deviation((g_b, covariance), rows.g_b)
    nees = squared.numpy().astype(float)
    error_deg = {"network": angles_deg(g_b.numpy().astype(float), epochs.g_b)}
    error_deg |= {name: angles_deg(baseline(name, epochs), epochs.g_b) for name in BASELINES}
    found = {f"{name}, RMS deg": rms(error) for name, error in error_deg.items()}
    found["network, NEES"] = float(nees.mean())
    found["network, % within the 95 % ellipse"] = 100.0 * float((nees < _WITHIN).mean())
    for k, phase in enumerate(PHASES):
        of = epochs.phase == k
        if of.any():
            found |= {f"{phase}: {name}, RMS deg": rms(e[of]) for name, e in error_deg.items()}
            found[f"{phase}: network, NEES"] = float(nees[of].mean())
    return found


def independent_after_s(
    net: GravityNet, world: GravityWorld, flights: int, *, rng: np.random.Generator
) -> float:
    """Return the time after which a network's errors may be counted as new ones.

    The mean of errors that last for a time T each has a variance of T over the span averaged. The
    errors are those of many flights, whitened by the network's covariance, turned to the frame n,
    in which an attitude takes them up; so T is the span times the mean's variance over theirs.
    """
    windows = msgspec.structs.replace(world.windows, per_flight=_EACH, flight_s=_SPAN_S)
    changed = msgspec.structs.replace(world, windows=windows, shard_epochs=_EACH)
    epochs = draw(changed, flights * _EACH, rng=rng)
    rows = Rows.of(epochs)
    with torch.no_grad():
        g_b, covariance = (t.double().numpy() for t in net(*rows.seen(aided=net.aided)))
    white_b = whitened(g_b, covariance, epochs.g_b)
    white_n = np.einsum("nij,nj->ni", epochs.R_nb, white_b).reshape(flights, _EACH, 3)
    of_means = (white_n.mean(axis=1) ** 2).sum()
    return float(round(_SPAN_S * of_means / (white_n**2).sum(axis=2).mean(axis=1).sum(), 2))


def whitened(g_b: FloatArray, covariance: FloatArray, true_b: FloatArray) -> FloatArray:
    """Return errors across ``g_b``, (n, 3), by the symmetric root of their inverse covariance."""
    apart = true_b - np.einsum("ni,ni->n", g_b, true_b)[:, None] * g_b
    sine = np.linalg.norm(apart, axis=1, keepdims=True)
    angle = np.arctan2(sine, np.einsum("ni,ni->n", g_b, true_b)[:, None])
    error = apart * angle / np.maximum(sine, 1e-12)
    values, axes = np.linalg.eigh(covariance)
    inside = np.einsum("nij,ni->nj", axes[:, :, 1:], error) / np.sqrt(values[:, 1:])
    return np.asarray(np.einsum("nij,nj->ni", axes[:, :, 1:], inside))

"""Proper scores of a posterior against the truth, as losses that torch differentiates [1]_.

References
----------
.. [1] Gneiting, Raftery: Strictly proper scoring rules, prediction, and estimation, JASA 102, 2007.
"""

from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np
import torch

from fgnav.evaluation.figures import normal_nodes
from fgnav.evaluation.reference import covered, truth_at
from fgnav.types.flight import Truth
from fgnav_models.learn.answers import Tensor, log
from fgnav_models.learn.posterior import Posterior

Scored: TypeAlias = Literal["attitude", "position", "velocity"]
_PLACES = {"attitude": (0, 1, 2), "position": (3, 4, 5), "velocity": (6, 7, 8)}


def nll(
    posterior: Posterior, truth: Truth, of: Sequence[Scored] = ("attitude", "position", "velocity")
) -> Tensor:
    """Return the mean over keyframes of minus the joint log density of the truth, a scalar.

    Parameters
    ----------
    posterior : Posterior
    truth : Truth
        Keyframes beyond its span do not count.
    of : sequence of {"attitude", "position", "velocity"}
    """
    error, covariance = errors(posterior, truth, of)
    normal = torch.distributions.MultivariateNormal(torch.zeros_like(error), covariance)
    found: Tensor = -normal.log_prob(error).mean()
    return found


def energy_score(posterior: Posterior, truth: Truth, of: Scored) -> Tensor:
    """Return the mean energy score of one quantity, in rad, m or m/s; as ``evaluation.figures``.

    Parameters
    ----------
    posterior, truth
        As of ``nll``.
    of : {"attitude", "position", "velocity"}
    """
    error, covariance = errors(posterior, truth, (of,))
    draws = torch.from_numpy(normal_nodes(3)) @ torch.linalg.cholesky(covariance).mT
    near = (draws - error[:, None]).norm(dim=2).mean()
    return near - draws.norm(dim=2).mean() / 2**0.5


def errors(posterior: Posterior, truth: Truth, of: Sequence[Scored]) -> tuple[Tensor, Tensor]:
    """Return truth less mean, (t, d), and its covariances, (t, d, d); arguments as of ``nll``."""
    rows = np.flatnonzero(covered(truth, posterior.t_s))
    real = truth_at(truth, posterior.t_s[rows])
    R_nb, p_n_m, v_n_mps = (torch.tensor(x) for x in (real.R_nb, real.p_n_m, real.v_n_mps))
    parts = {
        "attitude": log(posterior.R_nb[rows].mT @ R_nb),
        "position": p_n_m - posterior.p_n_m[rows],
        "velocity": v_n_mps - posterior.v_n_mps[rows],
    }
    indices = torch.tensor([i for name in of for i in _PLACES[name]])
    covariance = posterior.covariance[rows][:, indices[:, None], indices]
    return torch.cat([parts[name] for name in of], dim=1), covariance

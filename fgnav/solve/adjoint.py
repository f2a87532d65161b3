"""Log-likelihood of the truth in a linearised flight, and its derivatives by measurements.

A problem is linearised once; measurements with residuals r, Jacobians J = [J_x, J_c] by one
keyframe each and by the constants, and covariances C enter it. Posterior marginals of the judged
coordinates of keyframe t, mean error e_t and covariance P_t, state

    NLL = mean over t of (e_t' P_t^-1 e_t + log det P_t + d log 2 pi) / 2.

With ``a_t = P_t^-1 e_t``, ``B_t = (P_t^-1 - a_t a_t') / 2`` (each over the number of keyframes),
``l = P a`` and ``M = P B P``, ``W = C^-1``, x the posterior mean and ``r^`` the residual there,
docs/theory/covariance.md has

    dNLL/dr = -W J l        dNLL/dW = -sym(J l r^') - J M J'        dNLL/dC = -W dNLL/dW W
    dNLL/dJ = -W (2 J M + J l x' + r^ l').

P is that of all keyframes. Of one and the constants, V = D + b dimensions, elimination leaves

    (x_k, c) = E_k (x_k+1, c) + what later data do not change        E_k = [-gain_k; 0 I]

and with S_k the covariance of (x_k, c), a right-hand side a and an information B of each keyframe,

    f_k+1 = E_k' f_k + a_k+1                      l_k = E_k (S_k+1 a_k+1 + l_k+1)
    F_k+1 = E_k' F_k E_k + B_k+1                  R_k = E_k (S_k+1 B_k+1 S_k+1 + R_k+1) E_k'
    (P a)_k,c = S_k f_k + l_k                     (P B P)_kc,kc = S_k F_k S_k + R_k
"""

from dataclasses import dataclass
from typing import NamedTuple

import gtsam
import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.graph.build import Layout
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.solve.elimination import Elimination
from fgnav.solve.linear import keyframe_factor, linearise


class Judged(NamedTuple):
    """The truth as steps from where a flight is linearised, in some coordinates of its tangent."""

    row: IntArray  # (t,), keyframes
    which: IntArray  # (d,), coordinates: 0 to 2 attitude, 6 to 8 velocity
    step: FloatArray  # (t, d)


class Likelihood(NamedTuple):
    """A negative log-likelihood of the truth, and its derivatives by given measurements."""

    nll: float
    by_residual: FloatArray  # (m, f)
    by_covariance: FloatArray  # (m, f, f), symmetric
    by_shared: FloatArray  # (m, f, b)
    error: FloatArray  # (t, d), posterior mean less truth
    covariance: FloatArray  # (t, d, d), what the posterior states of it


class _Posterior(NamedTuple):
    mean: FloatArray  # (n, V), steps of each keyframe and the constants
    covariance: FloatArray  # (n, V, V)
    follows: FloatArray  # (n - 1, V, V), E


@dataclass(frozen=True, eq=False, slots=True)
class LinearisedFlight:
    """A smoothing problem linearised at states.

    Attributes
    ----------
    problem : Problem
    factors : list of list of gtsam.GaussianFactor
        By the oldest keyframe of each.
    """

    problem: Problem
    factors: list[list[gtsam.GaussianFactor]]

    @classmethod
    def at(cls, problem: Problem, states: States) -> "LinearisedFlight":
        """Linearise a problem.

        Raises
        ------
        BadInputError
            If it has ambiguities, which change from keyframe to keyframe.
        """
        if problem.phase is not None:
            raise BadInputError(
                "training through the smoother: carrier phase of single antennas is not "
                "differentiated; take flights with fixes"
            )
        rows = np.arange(len(problem.t_s))
        linear = linearise(problem, rows, states, states.at(rows[:-1]))
        return cls(problem, linear.factors_by_keyframe())

    def likelihood(
        self,
        row: IntArray,
        jacobian: FloatArray,
        residual: FloatArray,
        covariance: FloatArray,
        judged: Judged,
        shared: FloatArray | None = None,
    ) -> Likelihood:
        """Compute the log-likelihood of the truth given the measurements.

        Parameters
        ----------
        row : ndarray of int, shape (m,)
            Their keyframes.
        jacobian : ndarray, shape (m, f, D)
            By the keyframe's tangent.
        residual : ndarray, shape (m, f)
            Estimate less measurement where the flight is linearised.
        covariance : ndarray, shape (m, f, f)
        judged : Judged
        shared : ndarray, shape (m, f, b), optional
            By the constants; none by default.

        Raises
        ------
        NoSolutionError
            Naming the state that is left open, and when.
        """
        if shared is None:
            shared = np.zeros((*residual.shape, self.problem.constants.width))
        J = np.concatenate([jacobian, shared], axis=2)
        root = np.linalg.cholesky(covariance)
        whitened = np.linalg.solve(root, np.concatenate([residual[:, :, None], J], axis=2))
        posterior = self._posterior(row, whitened)
        which, at = judged.which, judged.row
        P = posterior.covariance[at[:, None, None], which[:, None], which]
        error = posterior.mean[at[:, None], which] - judged.step
        information = np.linalg.inv(P)
        weighed = np.einsum("tij,tj->ti", information, error)
        t, d = error.shape
        nll = np.einsum("ti,ti->", error, weighed) + np.linalg.slogdet(P)[1].sum()
        a, B = np.zeros_like(posterior.mean), np.zeros_like(posterior.covariance)
        a[at[:, None], which] = weighed / t
        outer = weighed[:, :, None] * weighed[:, None, :]
        B[at[:, None, None], which[:, None], which] = (information - outer) / (2 * t)
        solved, blocks = (part[row] for part in _adjoint(posterior, a, B))
        W, mean = np.linalg.inv(covariance), posterior.mean[row]
        by_mean = np.einsum("mfv,mv->mf", J, solved)
        at_mean = residual + np.einsum("mfv,mv->mf", J, mean)
        both = by_mean[:, :, None] * at_mean[:, None, :]
        by_W = -(both + both.swapaxes(1, 2)) / 2 - J @ blocks @ J.swapaxes(1, 2)
        by_J = 2 * J @ blocks + by_mean[:, :, None] * mean[:, None, :]
        by_J += at_mean[:, :, None] * solved[:, None, :]
        return Likelihood(
            nll=float(nll / t + d * np.log(2 * np.pi)) / 2,
            by_residual=-np.einsum("mij,mj->mi", W, by_mean),
            by_covariance=-W @ by_W @ W,
            by_shared=-W @ by_J[:, :, jacobian.shape[2] :],
            error=error,
            covariance=P,
        )

    def _posterior(self, row: IntArray, whitened: FloatArray) -> _Posterior:
        """Return the flight with whitened residuals and Jacobians, (m, f, 1 + D + b), as well."""
        layout, t_s = Layout.of(self.problem), self.problem.t_s
        elimination = Elimination(layout, lambda k: float(t_s[k]))
        given: dict[int, list[gtsam.GaussianFactor]] = {}
        for k, rows in zip(row.tolist(), whitened, strict=True):
            factor = keyframe_factor(layout, k, rows[:, 1:], -rows[:, 0])
            given.setdefault(k, []).append(factor)
        for k, factors in enumerate(self.factors):
            elimination.append([*factors, *given.get(k, ())])
        elimination.solve()
        steps, constants, _ = elimination.step()
        covariance, _, constant, shared = elimination.marginals()
        (n, D), b = steps.shape, len(constants)
        S, E = np.empty((n, D + b, D + b)), np.zeros((n - 1, D + b, D + b))
        S[:, :D, :D], S[:, :D, D:], S[:, D:, D:] = covariance, shared, constant
        S[:, D:, :D] = shared.swapaxes(1, 2)
        E[:, :D], E[:, D:, D:] = -elimination.gains(), np.eye(b)
        mean = np.concatenate([steps, np.broadcast_to(constants, (n, b))], axis=1)
        return _Posterior(mean, S, E)


def _adjoint(posterior: _Posterior, a: FloatArray, B: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return P a and the blocks of P B P of each keyframe and the constants, (n, V), (n, V, V)."""
    S, E = posterior.covariance, posterior.follows
    f, F = a.copy(), B.copy()
    for k, E_k in enumerate(E):
        f[k + 1] += E_k.T @ f[k]
        F[k + 1] += E_k.T @ F[k] @ E_k
    later, R = np.einsum("nij,nj->ni", S, a), S @ B @ S
    for k in range(len(E) - 1, 0, -1):
        later[k] += E[k] @ later[k + 1]
        R[k] += E[k] @ R[k + 1] @ E[k].T
    solved, blocks = np.einsum("nij,nj->ni", S, f), S @ F @ S
    solved[:-1] += np.einsum("nij,nj->ni", E, later[1:])
    blocks[:-1] += E @ R[1:] @ E.swapaxes(1, 2)
    return solved, blocks

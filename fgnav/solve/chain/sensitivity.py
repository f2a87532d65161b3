"""How likely a chain holds the truth, and how that answers to what given measurements say.

A problem is linearised once; measurements with residuals r, Jacobians J = [J_x, J_c] by one
keyframe each and by the constants, and covariances C enter it. Posterior marginals of the judged
coordinates of keyframe t, mean error e_t and covariance P_t, state

    NLL = mean over t of (e_t' P_t^-1 e_t + log det P_t + d log 2 pi) / 2.

With ``a_t = P_t^-1 e_t``, ``B_t = (P_t^-1 - a_t a_t') / 2`` (each over the number of keyframes),
``l = P a`` and ``M = P B P`` by ``sensitivity_kernel.adjoint``, ``W = C^-1``, x the posterior mean
and ``r^`` the residual there, docs/model.md derives

    dNLL/dr = -W J l        dNLL/dW = -sym(J l r^') - J M J'        dNLL/dC = -W dNLL/dW W
    dNLL/dJ = -W (2 J M + J l x' + r^ l').
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.solve.chain import back_kernel, kernel, sensitivity_kernel
from fgnav.solve.chain.linear import Links, linearise
from fgnav.solve.failures import weakest_state


class Judged(NamedTuple):
    """The truth as steps from where a chain is linearised, in some coordinates of its tangent."""

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


class _Open(NamedTuple):
    row: int
    information: FloatArray  # of its state and the constants, by keyframes up to it


class _Solved(NamedTuple):
    gain: FloatArray
    steps: FloatArray  # (n, D)
    constants: FloatArray  # (b,)
    covariance: FloatArray  # (n, D, D)
    shared: FloatArray  # (n, D, b)
    constant: FloatArray  # (b, b)


@dataclass(frozen=True, eq=False, slots=True)
class LinearisedFlight:
    """A smoothing problem linearised at states."""

    problem: SmoothingProblem
    links: Links

    @classmethod
    def at(cls, problem: SmoothingProblem, states: States) -> "LinearisedFlight":
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
        n, rows = len(problem.t_s), np.arange(len(problem.t_s))
        links = Links.empty(n, problem.width, problem.constants.width)
        linearise(problem, rows, states, states.at(slice(0, n - 1)), links, rows)
        return cls(problem, links)

    def likelihood(
        self,
        row: IntArray,
        jacobian: FloatArray,
        residual: FloatArray,
        covariance: FloatArray,
        judged: Judged,
        shared: FloatArray | None = None,
    ) -> Likelihood:
        """Return how likely the truth is beside given measurements.

        Parameters
        ----------
        row : ndarray of int, shape (m,)
            Their keyframes.
        jacobian : ndarray, shape (m, f, D)
            By the keyframe's tangent.
        residual : ndarray, shape (m, f)
            Estimate less measurement where the chain is linearised.
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
        solved = self._solved(row, whitened)
        which = judged.which
        P = solved.covariance[judged.row[:, None, None], which[:, None], which]
        error = solved.steps[judged.row[:, None], which] - judged.step
        information = np.linalg.inv(P)
        weighed = np.einsum("tij,tj->ti", information, error)
        t, d = error.shape
        nll = np.einsum("ti,ti->", error, weighed) + np.linalg.slogdet(P)[1].sum()
        a, B = np.zeros_like(solved.steps), np.zeros_like(solved.covariance)
        a[judged.row[:, None], which] = weighed / t
        outer = weighed[:, :, None] * weighed[:, None, :]
        B[judged.row[:, None, None], which[:, None], which] = (information - outer) / (2 * t)
        n, V = len(a), a.shape[1] + len(solved.constant)
        led, blocks = sensitivity_kernel.adjoint(
            solved.gain,
            solved.covariance,
            solved.shared,
            solved.constant,
            a,
            B,
            np.zeros((n, V)),
            np.zeros((n, V, V)),
        )
        W, led, blocks = np.linalg.inv(covariance), led[row], blocks[row]
        mean = np.broadcast_to(solved.constants, (len(row), len(solved.constants)))
        mean = np.concatenate([solved.steps[row], mean], axis=1)
        by_mean = np.einsum("mfv,mv->mf", J, led)
        at_mean = residual + np.einsum("mfv,mv->mf", J, mean)
        both = by_mean[:, :, None] * at_mean[:, None, :]
        by_W = -(both + both.swapaxes(1, 2)) / 2 - J @ blocks @ J.swapaxes(1, 2)
        by_J = 2 * J @ blocks + by_mean[:, :, None] * mean[:, None, :]
        by_J += at_mean[:, :, None] * led[:, None, :]
        return Likelihood(
            nll=float(nll / t + d * np.log(2 * np.pi)) / 2,
            by_residual=-np.einsum("mij,mj->mi", W, by_mean),
            by_covariance=-W @ by_W @ W,
            by_shared=-W @ by_J[:, :, jacobian.shape[2] :],
            error=error,
            covariance=P,
        )

    def _solved(self, row: IntArray, whitened: FloatArray) -> _Solved:
        """Return the chain solved with whitened residuals and Jacobians, (m, f, 1 + D + b)."""
        found = self._eliminated(row, whitened, by_rows=False)
        if isinstance(found, _Open):  # perhaps squares have not digits enough
            found = self._eliminated(row, whitened, by_rows=True)
        if isinstance(found, _Solved):
            return found
        of, t_s = self.problem, float(self.problem.t_s[found.row])
        raise weakest_state(found.information, of.width, of.constants, t_s)

    def _eliminated(self, row: IntArray, whitened: FloatArray, *, by_rows: bool) -> _Solved | _Open:
        motion, node = self.links.motion, self.links.node.copy()
        n, D, b = len(node), motion.shape[1], self.problem.constants.width
        value, state = np.ascontiguousarray(whitened[:, :, 0]), whitened[:, :, 1 : D + 1].copy()
        kernel.add_squares(node, row, value, state, whitened[:, :, D + 1 :].copy())
        forward, roots = np.empty_like(node), np.zeros((n, D, D))
        gain = np.empty((n - 1, D, D + b + 1))
        forward[0] = node[0]
        failed = kernel.eliminate(motion, node, forward, roots, gain, by_rows)
        if failed >= 0:
            return _Open(int(failed), forward[failed])
        end, P = np.empty(D + b), np.empty((D + b, D + b))
        if not np.isfinite(back_kernel.newest(forward[-1], P, end)):
            return _Open(n - 1, forward[-1])
        steps, cross, shared = np.empty((n, D)), np.empty((n - 1, D, D)), np.empty((n, D, b))
        back_kernel.substitute(gain, end, steps)
        constant = P[D:, D:].copy()
        back_kernel.marginals(gain, roots, P, roots, cross, shared)
        return _Solved(gain, steps, end[D:].copy(), roots, shared, constant)

"""Attitudes where a cause is not certain: the second moment of all that are possible.

With R_j the attitudes of keyframes by hypothesis j, of probability s_j and covariance P_j beside
that of the states, attitudes R err besides by [1]_

    sum_j s_j (d_j d_j' + P_j)        d_j = log(R' R_j)

Of causes that are named, an instrument that is late is told from a clock of the unit, from lost
samples and from turned axes by little else than how rates change. What is known of each constant
beforehand, a convention, weighs as much as the odds of a contradiction: n causes within these are
as likely as each other.

A cause is named at these odds alone, since a right flight is asked for many. Whether it is there is
another question: none named, the likeliest and what else explains as much are beforehand as likely
as that all is as stated.

References
----------
.. [1] Hoeting, Madigan, Raftery, Volinsky: Bayesian model averaging: a tutorial, Statistical
   Science 14, 1999.
"""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Flight


class _Weighed(Protocol):
    """A cause: what it is called, what it gains, and the attitudes of keyframes by it."""

    @property
    def kind(self) -> str: ...

    @property
    def nats(self) -> float: ...

    @property
    def R_nb(self) -> FloatArray: ...


class _Possible(_Weighed, Protocol):
    """A cause with the covariance that it adds to attitudes of keyframes, (n, 3, 3)."""

    @property
    def attitude_rad2(self) -> FloatArray: ...


class Rivals(NamedTuple):
    """What else is as likely, by name, and what attitudes are doubted for it."""

    kinds: tuple[str, ...]
    doubt: AttitudeDoubt

    @property
    def sentence(self) -> str:
        """What is to be said of them."""
        return f"As likely instead: {', '.join(self.kinds)}; sigmas of attitudes hold both."


class Possible(NamedTuple):
    """Causes none of which is named: a flight is as it was, and its attitudes are doubted."""

    kinds: tuple[str, ...]
    doubt: AttitudeDoubt
    kind: str = "possible"
    is_likely: bool = False
    rivals: Rivals | None = None
    requests: tuple[CalibrationRequest, ...] = ()
    sentences: tuple[str, ...] = ()

    def undone(self, flight: Flight) -> Flight:
        """Return the same flight."""
        return flight

    def in_doubt(self, problem: SmoothingProblem) -> SmoothingProblem:
        """Return the same problem."""
        return problem


def rivals_of(best: _Weighed, others: Iterable[_Weighed], t_s: FloatArray) -> Rivals | None:
    """Return which others are as likely as the best; None where there are none.

    Parameters
    ----------
    best : _Weighed
    others : iterable of _Weighed
        That may stand for it.
    t_s : ndarray, shape (n,)
        Of keyframes.
    """
    near = [one for one in others if one.nats > best.nats - EXCLUDED]
    if not near:
        return None
    squares = sum(_squares(best.R_nb, one.R_nb) for one in near) / (len(near) + 1)
    return Rivals(tuple(one.kind for one in near), AttitudeDoubt(t_s, np.asarray(squares)))


def possible(
    causes: Iterable[_Possible], other_nats: Iterable[float], t_s: FloatArray, stated_nb: FloatArray
) -> Possible:
    """Return what attitudes are doubted for causes that are not named.

    Parameters
    ----------
    causes : iterable of _Possible
        Each against none.
    other_nats : iterable of float
        What explanations gain that are sought elsewhere.
    t_s : ndarray, shape (n,)
        Of keyframes.
    stated_nb : ndarray, shape (n, 3, 3)
        Attitudes with all as stated.
    """
    causes = list(causes)
    nats = np.array([one.nats for one in causes])
    every = np.logaddexp.reduce([0.0, *nats, *other_nats])
    squares = sum(
        share * (_squares(stated_nb, one.R_nb) + one.attitude_rad2)
        for share, one in zip(np.exp(nats - every), causes, strict=True)
    )
    doubt = AttitudeDoubt(t_s, np.asarray(squares))
    return Possible(tuple(one.kind for one in causes), doubt)


def _squares(R_nb: FloatArray, other_nb: FloatArray) -> FloatArray:
    d = log(transpose(R_nb) @ other_nb)
    return np.asarray(d[:, :, None] * d[:, None])

"""Causes of which none is likelier than another by the odds of a contradiction.

An instrument that is late is told from a clock of the unit, from lost samples and from turned axes
by little else than how rates change. What is known of each constant beforehand, a convention,
weighs as much as that: n causes within these odds are as likely as each other. With R_j the
attitudes at the minimum of each, those by the likeliest, R, err besides by

    sum_j d_j d_j' / n        d_j = log(R' R_j)
"""

from collections.abc import Iterable
from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import expit

from fgnav.checks import FloatArray
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.geometry.rotations import log, transpose
from fgnav.identification.track.windows import EXCLUDED


class _Weighed(Protocol):
    """A cause: what it is called, what it gains, and the attitudes of keyframes by it."""

    @property
    def kind(self) -> str: ...

    @property
    def nats(self) -> float: ...

    @property
    def R_nb(self) -> FloatArray: ...


class Rivals(NamedTuple):
    """What else is as likely, by name, and what attitudes are doubted for it."""

    kinds: tuple[str, ...]
    doubt: AttitudeDoubt

    @property
    def sentence(self) -> str:
        """What is to be said of them."""
        return f"As likely instead: {', '.join(self.kinds)}; sigmas of attitudes hold both."


def rivals_of(
    best: _Weighed, others: Iterable[_Weighed], t_s: FloatArray, stated_nb: FloatArray
) -> Rivals | None:
    """Return which others are as likely as the best; None where there are none.

    Parameters
    ----------
    best : _Weighed
    others : iterable of _Weighed
        That may stand for it.
    t_s : ndarray, shape (n,)
        Of keyframes.
    stated_nb : ndarray, shape (n, 3, 3)
        Attitudes with all as stated: those that stand where the best is not taken for true.
    """
    near = [one for one in others if one.nats > best.nats - EXCLUDED]
    if not near:
        return None
    R_nb = best.R_nb if best.nats > EXCLUDED else stated_nb
    apart = np.stack([log(transpose(R_nb) @ one.R_nb) for one in near])
    share = float(expit(best.nats - EXCLUDED)) / (len(near) + 1)
    squares = share * np.einsum("jni,jnk->nik", apart, apart)
    return Rivals(tuple(one.kind for one in near), AttitudeDoubt(t_s, squares))

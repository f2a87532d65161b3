"""Whether a flight has an atmosphere: what the code residuals of its first epochs tell.

A recorded flight has one, a simulated one may not. Residuals of the code are smaller with the
models where there is one, and as small as the stated noise without them where there is none. By
chance they are as small in air: of six satellites whose errors have a sigma of eight times the
code's noise in 2 % of flights, and heights are ten metres off then. So messages that state an
ionosphere are believed as long as none is not far likelier.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.least_squares import FALSE_ALARM
from fgnav.gnss.single_point.adjustment import Adjusted, adjust, growing, misfits
from fgnav.gnss.single_point.model import CodeChannels, code_ranges
from fgnav.types.flight import Flight
from fgnav.types.instruments import GnssNoise
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits

STATED_NOISE = 1.5  # squared residuals per freedom that still agree with the stated noise
_DECIDING = (1, 2, 4, 8, 16, 32, 64)  # epochs with an answer after which it is decided anew
_BLOCK = 64  # epochs looked at together


class Deciding(NamedTuple):
    """What k epochs with redundant code tell, of m satellites."""

    epoch: IntArray  # (k,): which these are
    # Squared residuals per degree of freedom, over the variance of the code's noise, with models
    # and without.
    squares: FloatArray  # (k, 2)
    # Degrees of freedom; squared residuals with models over the variance that messages, models and
    # noise have then; the mean logarithm of that variance over the noise's.
    stated: FloatArray  # (k, 3)
    residuals: FloatArray  # (k, m): without models, over the noise; NaN where there is none

    @classmethod
    def of(
        cls, noise: GnssNoise, epoch: IntArray, with_models: Adjusted, without: Adjusted
    ) -> "Deciding":
        """Return it of epochs, (n,), that are adjusted with models and without."""
        squares = np.stack([misfits(noise, one) for one in (with_models, without)], axis=1)
        redundant = np.isfinite(squares).all(axis=1)
        at, use = with_models.equations, with_models.use
        larger = at.variance_m2 / growing(noise, noise.code_m, at.elevation_rad) ** 2
        weighted = np.where(use, with_models.fits.residual**2 / at.variance_m2, 0.0).sum(axis=1)
        mean = np.log(np.where(use, larger, 1.0)).sum(axis=1) / use.sum(axis=1).clip(1)
        stated = np.stack([with_models.fits.freedom, weighted, mean], axis=1)
        sigma_m = growing(noise, noise.code_m, without.equations.elevation_rad)
        residuals = np.where(without.use, without.fits.residual / sigma_m, np.nan)
        return cls(epoch[redundant], squares[redundant], stated[redundant], residuals[redundant])

    def first(self, count: int) -> "Deciding":
        """Return what the first epochs tell."""
        return Deciding._make(one[:count] for one in self)

    def is_without(self, broadcast: BroadcastOrbits | None) -> bool:
        """Return whether there is no atmosphere; what is median of the epochs decides."""
        if not len(self.epoch):
            return False
        is_stated = broadcast is not None and bool(broadcast.klobuchar.any())
        if is_stated and not self._log_odds() > -np.log(FALSE_ALARM):
            return False
        with_models, without = np.median(self.squares, axis=0)
        return bool(without < min(with_models, STATED_NOISE))

    def _log_odds(self) -> float:
        """Return how much likelier residuals are without an atmosphere than with one.

        With one they err alike at n epochs, of variance v over the noise's: the f of their means
        that are to spare, over their noise, have variance ``n v``, and one without it,
        ``(s_with - s_without + f ln(n v)) / 2``, s their squares over these.
        """
        f, s, mean = np.median(self.stated, axis=0)
        n = np.isfinite(self.residuals).sum(axis=0)
        means = np.nansum(self.residuals, axis=0) / np.sqrt(n.clip(1))
        epochs = np.median(n[n > 0])
        return float(s - (means**2).sum() + f * (mean + np.log(epochs))) / 2


def atmosphere_so_far(
    flight: Flight, observations: Observations, channels: CodeChannels
) -> BoolArray:
    """Return whether atmosphere models are to be applied at each epoch, (n,), by those up to it.

    Decided after 1, 2, 4, … 64 epochs with redundant code, and kept from there on; applied before.
    """
    n = len(observations.t_s)
    if observations.earlier is not None:
        return np.full(n, observations.earlier.has_atmosphere)
    applied = np.ones(n, dtype=np.bool_)
    deciding = _deciding(flight, observations, channels)
    for count in _DECIDING:
        if count <= len(deciding.epoch):
            is_without = deciding.first(count).is_without(flight.broadcast)
            applied[deciding.epoch[count - 1] :] = not is_without
    return applied


def is_decided(flight: Flight, observations: Observations, channels: CodeChannels) -> bool:
    """Return whether ``atmosphere_so_far`` says the same of all epochs to come."""
    if observations.earlier is not None:
        return True
    return len(_deciding(flight, observations, channels).epoch) >= _DECIDING[-1]


def _deciding(flight: Flight, observations: Observations, channels: CodeChannels) -> Deciding:
    """Return what the first epochs with redundant code tell."""
    n, blocks, count = len(observations.t_s), list[Deciding](), 0
    for first in range(0, n, _BLOCK):
        epoch = np.arange(first, min(first + _BLOCK, n))
        ranges = code_ranges(flight, observations, channels, 0, epoch, rates=False)
        wanted = np.isfinite(ranges.range_m)
        adjusted = (
            adjust(flight, channels, ranges, wanted, model=model, each=True)
            for model in (True, False)
        )
        blocks.append(Deciding.of(flight.gnss_noise, epoch, *adjusted))
        count += len(blocks[-1].epoch)
        if count >= _DECIDING[-1]:
            break
    return Deciding._make(map(np.concatenate, zip(*blocks, strict=True)))

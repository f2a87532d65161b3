"""An inertial unit whose own samples are louder than it states, for seconds or all along.

Noise for a while puts velocities off by less than other sensors show at once. Sixth differences of
samples, of which smooth motion leaves next to nothing, have 924 times the variance of white noise,
by their median over half a second s^2. Noise that loud down to the lowest frequencies has the
density s^2 T, T between samples; a vibration far less. Between it and the stated N^2

    N(a) = N (s sqrt(T) / N)^a,  0 <= a <= 1        N^2 = sum N(a)^2 L(a) / sum L(a)

with L the likelihood of the thinned chain. Of a unit that is louder all along, s is that of the
quietest half second, and what the flight itself tells by the odds of any contradiction is
identified instead. Where noise as loud as s leaves more than chance it is none.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.special import chdtri, comb

from fgnav.checks import FloatArray
from fgnav.frontend.prepared import PreparedFlight
from fgnav.graph.innovation.band import TOLERATED
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.thinned import FIELDS
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.noise.denoised import NORMAL, ORDER
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.spans.errors import SAMPLES
from fgnav.identification.track.windows import EXCLUDED, FALSE_ALARM
from fgnav.types.flight import Flight, Imu

_BLOCK_S = 0.5
# Independent ones of such differences, by correlations of neighbours, times the efficiency of a
# median of sizes, .37 (Rousseeuw, Croux, JASA 88, 1993).
_INDEPENDENT = 0.37 * comb(12, 6) ** 2 / (comb(12, range(13)) ** 2).sum()
_NODES, _WEIGHTS = np.linspace(0.0, 1.0, 5), np.array([0.5, 1.0, 1.0, 1.0, 0.5])
Change = Callable[[SmoothingProblem], SmoothingProblem]


def noise_of_samples(
    flight: Flight, prepared: PreparedFlight
) -> tuple[tuple[Change, ...], tuple[str, ...]]:
    """Return what makes the unit of a problem as loud as it is, and what is to be said of it."""
    changes: list[Change] = []
    notes, imu = [], prepared.imu
    for sensor in WHITE:
        ratio = _seen(imu, sensor)
        if FIELDS[sensor] in imu.unstated or (ratio == 1.0).all():
            continue
        is_throughout = (ratio > 1.0).all()
        if is_throughout:
            ratio = np.full_like(ratio, ratio.min())
        candidates = [prepared.changed(_noise_added(imu, sensor, ratio**a)) for a in _NODES]
        flights = [ThinnedFlight.of(flight, one, ()) for one in candidates]
        scores = [one.score_at({}) for one in flights]
        loudest = scores[-1]
        if loudest is None or flights[-1].is_misfit(loudest):
            continue  # no noise that its samples hold: a fault is identified
        likelihood = np.array([-np.inf if one is None else one.log_likelihood for one in scores])
        if is_throughout and likelihood.max() > likelihood[0] + EXCLUDED:
            continue  # what the flight itself tells is identified
        weight = _WEIGHTS * np.exp(likelihood - likelihood.max())
        square = weight @ ratio ** _NODES[:, None] / weight.sum()
        (loud,) = np.nonzero(square > TOLERATED)
        if len(loud):
            changes.append(_noise_added(imu, sensor, square))
            prepared = prepared.changed(changes[-1])
            from_s, until_s = imu.t_s[0] + _BLOCK_S * np.array([loud[0], loud[-1] + 1])
            notes.append(
                f"The {sensor}'s samples are louder than its noise from {from_s:.1f} to "
                f"{until_s:.1f} s: up to {np.sqrt(square.max()):.2g} x what flight.toml states is "
                "used there."
            )
    return tuple(changes), tuple(notes)


def _seen(imu: Imu, sensor: str) -> FloatArray:
    """Return s^2 T / N^2 of blocks of half a second, (m,); 1 where that is as stated."""
    x, N = getattr(imu, SAMPLES[sensor]), getattr(imu, FIELDS[sensor])
    block = np.floor((imu.t_s - imu.t_s[0]) / _BLOCK_S).astype(np.int64)
    ratio = np.ones(int(block[-1]) + 1)
    if x is None or not N or len(x) <= ORDER:
        return ratio
    interval_s, half = float(np.median(np.diff(imu.t_s))), ORDER // 2
    is_even = imu.t_s[ORDER:] - imu.t_s[:-ORDER] < (ORDER + 0.5) * interval_s
    sixth, block = np.abs(np.diff(x, ORDER, axis=0))[is_even], block[half:-half][is_even]
    edges = np.searchsorted(block, np.arange(len(ratio) + 1))
    for k in np.flatnonzero(np.diff(edges)):
        sigma = NORMAL * np.median(sixth[edges[k] : edges[k + 1]], axis=0)
        seen = (sigma**2).mean() / comb(2 * ORDER, ORDER) * interval_s / N**2
        freedom = _INDEPENDENT * 3 * (edges[k + 1] - edges[k])
        if seen > max(TOLERATED, chdtri(freedom, FALSE_ALARM) / freedom):
            ratio[k] = seen
    # It may begin and end within a block, of which a median shows less than half.
    return np.asarray(maximum_filter1d(ratio, 3))


def _noise_added(imu: Imu, sensor: str, ratio: FloatArray) -> Change:
    """Return what gives a problem's unit so many times its stated density in blocks, (m,)."""
    more, begin_s = (ratio - 1.0) * getattr(imu, FIELDS[sensor]) ** 2, imu.t_s[0]

    def changed(problem: SmoothingProblem) -> SmoothingProblem:
        middle_s = (problem.t_s[1:] + problem.t_s[:-1]) / 2
        block = np.floor((middle_s - begin_s) / _BLOCK_S).astype(np.int64)
        at = more[block.clip(0, len(more) - 1)]
        densities = (at * (sensor == one) for one in WHITE)
        return replace(problem, motion=problem.motion.with_added_noise(*densities))

    return changed

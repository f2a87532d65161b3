"""Where a recording has holes: keyframes within them, straight lines across, and what to say."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.flight import Imu
from fgnav.methods.smoother.preintegration import RATE_SPAN_S, Preintegrator, angular_rates
from fgnav.rotations import exp, log, transpose

LONGEST_GAP_S = 0.5  # longer ones are bridged with what little is known, and told
# Between keyframes. With GNSS once a second and a sine of 20 degrees, twice as much puts the
# accelerometer's bias off by 1.5 sigma.
LONGEST_STEP_S = 0.1
_ROUNDING = 1.5  # intervals: a tag that is late is no gap
_SEVERAL = 2.5  # usual intervals without a measurement are worth a sentence
_VAGUE_RAD = 1.0  # of an attitude that nothing tells
_CORRELATION_S = 2.0  # of what a body does while nobody measures it
LOST_S = 2.0  # from the next attitude: a body without a gyroscope may be anyhow by then
_SHORT_S = 0.3  # between attitudes: the usual intensity holds
_LENGTHEN = np.sqrt(2)  # of one pretended gap to the next
_MISPLACED = 0.05  # of a pretended gap, its middle and end
_FEWEST = 5  # pretended gaps
_GRAVITY_MPS2 = 9.8  # felt at least, most of the time
_TOLD = 5  # gaps of a kind that are told one by one


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Bridged:
    """An inertial record without gaps.

    Attributes
    ----------
    imu : Imu
        Straight lines across the gaps.
    loose : Imu
        The same, its noise that of not knowing: the record's own spread, held for two seconds.
    gaps_s : ndarray, shape (g, 2)
        Last sample before and first after each gap.
    """

    imu: Imu
    loose: Imu
    gaps_s: FloatArray

    def touched(self, t_s: FloatArray) -> BoolArray:
        """Return the keyframes, (n,), from which the way to the next touches a gap."""
        ended = np.searchsorted(self.gaps_s[:, 1], t_s[:-1], side="right")
        begun = np.searchsorted(self.gaps_s[:, 0], t_s[1:])
        return np.append(begun > ended, False)


def bridged(imu: Imu) -> Bridged:
    """Return a record whose gaps are filled with straight lines, at its own rate.

    Half of the specific force is not known, either, once the attitude is half a radian off.
    """
    step_s = np.diff(imu.t_s)
    gap = np.flatnonzero(step_s > LONGEST_GAP_S)
    gaps_s = np.stack([imu.t_s[gap], imu.t_s[gap + 1]], axis=1)
    whole = imu
    if len(gap):
        regular_s = min(float(np.median(step_s)), LONGEST_GAP_S)
        inside = [np.arange(a + regular_s, b - regular_s / 2, regular_s) for a, b in gaps_s]
        t_s = np.union1d(imu.t_s, np.concatenate(inside))
        rates = None if imu.w_b_radps is None else _lines(imu, t_s, imu.w_b_radps)
        whole = replace(imu, t_s=t_s, f_b_mps2=_lines(imu, t_s, imu.f_b_mps2), w_b_radps=rates)
    size = max((imu.f_b_mps2**2).sum(axis=1).mean(), _GRAVITY_MPS2**2)
    spread = imu.f_b_mps2.var(axis=0).max() + size / 4
    loose = replace(whole, accelerometer_noise_mps2_per_sqrt_hz=_as_white(spread))
    if imu.w_b_radps is not None:
        noise = _as_white(imu.w_b_radps.var(axis=0).max())
        noise = max(noise, imu.gyroscope_noise_radps_per_sqrt_hz or 0.0)
        loose = replace(loose, gyroscope_noise_radps_per_sqrt_hz=noise)
    return Bridged(imu=whole, loose=loose, gaps_s=gaps_s)


def keyframe_times(epochs_s: FloatArray) -> FloatArray:
    """Return GNSS epochs, (k,), and times between them where they lie too far apart, (n,)."""
    if len(epochs_s) < 2:
        return epochs_s
    span_s = np.diff(epochs_s)
    step_s = min(float(np.median(span_s)), LONGEST_STEP_S)
    parts = np.where(span_s > _ROUNDING * step_s, np.ceil(span_s / step_s - 1e-6), 1).astype(int)
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    between_s = np.repeat(epochs_s[:-1], parts) + within * np.repeat(span_s / parts, parts)
    return np.append(between_s, epochs_s[-1])


def spans(t_s: FloatArray, missing: BoolArray) -> FloatArray:
    """Return the spans, (g, 2), in which something is missing for longer than it usually is.

    From the last time that has it, or else the first, to the next that does, or else the last.
    """
    there_s = t_s[~missing]
    usual_s = float(np.median(np.diff(there_s))) if len(there_s) > 1 else 0.0
    edges = np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8))
    first, after = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    found = np.stack([t_s[(first - 1).clip(0)], t_s[after.clip(max=len(t_s) - 1)]], axis=1)
    return np.asarray(found[found[:, 1] - found[:, 0] > max(LONGEST_GAP_S, _SEVERAL * usual_s)])


def told(what: str, gaps_s: FloatArray) -> Iterator[str]:
    """Yield a sentence on each gap, or on how many more there are."""
    for from_s, until_s in gaps_s[:_TOLD]:
        yield f"No {what} from {from_s:.2f} to {until_s:.2f} s."
    more = gaps_s[_TOLD:]
    if len(more):
        longest_s = float((more[:, 1] - more[:, 0]).max())
        yield f"No {what} in {len(more)} more gaps of up to {longest_s:.2f} s."


def _lines(imu: Imu, t_s: FloatArray, values: FloatArray) -> FloatArray:
    return np.stack([np.interp(t_s, imu.t_s, column) for column in values.T], axis=1)


def _as_white(variance: float) -> float:
    """Return the density of white noise that is as good as a process held for two seconds."""
    return float(np.sqrt(2 * _CORRELATION_S * variance))


def without_attitude(t_s: FloatArray, there: BoolArray, *, causal: bool = False) -> FloatArray:
    """Return how far each keyframe is from one with an attitude, s, (n,); causal: from the last."""
    if causal:
        return np.asarray(t_s - t_s[np.maximum.accumulate(np.where(there, np.arange(len(t_s)), 0))])
    known_s = t_s[there]
    after = np.searchsorted(known_s, t_s).clip(1, len(known_s) - 1)
    before_s, after_s = np.abs(t_s - known_s[after - 1]), np.abs(known_s[after] - t_s)
    return np.asarray(np.minimum(before_s, after_s))


def hardly_known(
    form: RotationQuadratic | None, R_nb: FloatArray, t_s: FloatArray, there: BoolArray
) -> RotationQuadratic:
    """Return a form that says next to nothing at keyframes without attitude, where others say none.

    Within a radian of the way between the neighbours, once in two seconds: so little that it loses
    to anything measured, and enough for a search that otherwise turns over and over. Without an
    array, None, that is all of it, about attitudes of other vectors.
    """
    lost = without_attitude(t_s, there) > 0 if form is not None else np.ones(len(t_s), np.bool_)
    spacing_s = np.gradient(t_s) if len(t_s) > 1 else np.ones(1)
    weight = lost * spacing_s / (2 * _CORRELATION_S) / (2 * _VAGUE_RAD**2)
    x = R_nb.reshape(-1, 9)
    vague = RotationQuadratic(
        information=weight[:, None, None] * np.eye(9),
        vector=weight[:, None] * x,
        constant=weight * (x**2).sum(axis=1),
        count=np.where(lost, 3, 0),
    )
    if form is None:
        return vague
    told_only = RotationQuadratic(
        information=form.information * there[:, None, None],
        vector=form.vector * there[:, None],
        constant=form.constant * there,
        count=form.count * there,
    )
    return told_only + vague


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class BridgingPreintegrator(Preintegrator):
    """Preintegrates gaps, too, with what little is known of them.

    Attributes
    ----------
    loose : Imu
        Of intervals that are loosened.
    holed, loosened : ndarray of bool, shape (n - 1,)
        Intervals that touch a gap of the inertial record; those, and others whose attitude is so
        little known that nobody can say where specific force points.
    density : ndarray, shape (n - 1, 3)
        Intensity of white angular acceleration of each interval; only without a gyroscope.
    """

    loose: Imu
    holed: BoolArray
    loosened: BoolArray
    density: FloatArray

    @property
    def noise(self) -> FloatArray:
        """Return the noise of each interval, (n - 1, 8), as ``Preintegrator`` does."""
        noise = super(BridgingPreintegrator, self).noise
        noise[self.loosened, :5] = self._densities(self.loose)
        if self.imu.gyroscope_bias_walk_radps_per_sqrt_s is None:
            noise[:, 5:] = self.density
        return noise


def density_in_gaps(
    t_s: FloatArray,
    R_nb: FloatArray,
    there: BoolArray,
    covariance_rad2: FloatArray,
    usual: FloatArray,
) -> FloatArray:
    """Return the intensity of white angular acceleration of each interval, (n - 1, 3).

    The usual one is that of the shortest times, and a body that swings wanders further than it says
    while nobody looks. So each gap between attitudes has its own: that with which a random walk of
    the rate errs half-way as much as the cubic through both ends does in pretended gaps all over
    the flight, of the gap's length or of a shorter one that asks for more: a swing errs most over a
    period, and by no more over many.

    Parameters
    ----------
    t_s, R_nb, there : ndarray, shape (n,), (n, 3, 3), (n,)
        Attitudes of keyframes, and which are measured.
    covariance_rad2 : ndarray, shape (k, 3, 3)
        Of those measured.
    usual : ndarray, shape (3,)
    """
    known = np.flatnonzero(there)
    density = np.tile(usual, (len(t_s) - 1, 1))
    length_s = np.diff(t_s[known])
    gaps = np.flatnonzero(length_s > max(_SHORT_S, _ROUNDING * float(np.median(length_s))))
    if not len(gaps):
        return density
    more = np.log(length_s[gaps].max() / _SHORT_S) / np.log(_LENGTHEN)
    spans_s = np.union1d(length_s[gaps], _SHORT_S * _LENGTHEN ** np.arange(np.ceil(more)))
    found = [_pretended(t_s[known], R_nb[known], covariance_rad2, span_s) for span_s in spans_s]
    asked = np.maximum.accumulate([usual, *found])[1:]
    for gap in gaps:
        density[known[gap] : known[gap + 1]] = asked[np.searchsorted(spans_s, length_s[gap])]
    return density


def _pretended(
    t_s: FloatArray, R_nb: FloatArray, covariance_rad2: FloatArray, span_s: float
) -> FloatArray:
    """Return the intensity, (3,), that pretended gaps of a length ask for; 0 without any."""
    begin = np.flatnonzero(t_s + span_s <= t_s[-1] + 1e-6)
    middle, end = (_nearest(t_s, t_s[begin] + share * span_s) for share in (0.5, 1.0))
    fits = np.abs(t_s[middle] - t_s[begin] - span_s / 2) < _MISPLACED * span_s
    fits &= np.abs(t_s[end] - t_s[begin] - span_s) < _MISPLACED * span_s
    begin, middle, end = begin[fits], middle[fits], end[fits]
    if len(begin) < _FEWEST:
        return np.zeros(3)
    rates = angular_rates(t_s, R_nb)
    length_s = (t_s[end] - t_s[begin])[:, None]
    share = (t_s[middle] - t_s[begin])[:, None] / length_s
    half = carried(R_nb[begin], R_nb[end], rates[begin], rates[end], length_s, share)
    error = log(transpose(half) @ R_nb[middle])
    noise = np.einsum("nii->ni", covariance_rad2).mean(axis=0)
    noise *= 1.5 + (span_s / 4 / RATE_SPAN_S) ** 2
    return np.asarray(192 * ((error**2).mean(axis=0) - noise).clip(0) / span_s**3)


def carried(
    first: FloatArray,
    last: FloatArray,
    first_radps: FloatArray,
    last_radps: FloatArray,
    span_s: FloatArray | float,
    share: FloatArray,
) -> FloatArray:
    """Return attitudes, (n, 3, 3), on the cubic between two attitudes with their rates.

    That is where a random walk of the rate goes. Both rates' mean is taken out first, so that a
    body may turn over between them.

    Parameters
    ----------
    first, last : ndarray, shape (n, 3, 3)
    first_radps, last_radps : ndarray, shape (n, 3)
        Body axes.
    span_s, share : ndarray, shape (n, 1) or ()
        Time between them, and the share of it that has passed.
    """
    mean = (first_radps + last_radps) / 2
    rest = log(transpose(first @ exp(span_s * mean)) @ last)
    bend = span_s * share * (1 - share) * (first_radps - last_radps) / 2
    turned = share**2 * (3 - 2 * share) * rest + bend
    return np.asarray(first @ exp(span_s * share * mean) @ exp(turned))


def _nearest(have_s: FloatArray, want_s: FloatArray) -> IntArray:
    after = np.searchsorted(have_s, want_s).clip(1, len(have_s) - 1)
    return np.asarray(
        np.where(want_s - have_s[after - 1] < have_s[after] - want_s, after - 1, after)
    )

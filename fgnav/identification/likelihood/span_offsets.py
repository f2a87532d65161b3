"""An offset of one sensor over a span of time: the likeliest of all spans, on a linearised chain.

An offset u of three axes between two times adds ``G u`` to the whitened rows there. With what is
left of these rows at the chain's minimum, -y, their Jacobian J and the smoothed covariance P, its
score, its information and what it gains of log likelihood are [1]_ [2]_

    s = sum G' y        N = sum G' (I - J P J') G        s' N^-1 s / 2

N of a span is a sum over pairs of intervals, so that all spans follow from cumulative sums. Across
a gap of GNSS its terms are large, and so is their rounding: as much as the most negative N has,
beside G' G, is added to all.

Noise that is not white, as that of vibration, leaves more in all of a record than chance does, and
a span of it is no fault. Of a long record the gain of the median window, by what it is of a right
flight, is such an overdispersion: gains are divided by it and covariances multiplied [3]_.

References
----------
.. [1] Willsky, Jones: A generalized likelihood ratio approach to the detection and estimation of
   jumps in linear systems, IEEE Transactions on Automatic Control 21, 1976.
.. [2] De Jong, Penzer: Diagnosing shocks in time series, Journal of the American Statistical
   Association 93, 1998: all of them from one smoothing.
.. [3] McCullagh, Nelder: Generalized Linear Models, 2nd edition, 1989, section 4.5.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import transpose
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.measurement import Linearised
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import AUX, POSITION, VELOCITY, States
from fgnav.identification.noise.begin import WHITE

_WINDOW = 120  # intervals at a time, half of them of the window before: spans are no longer
TURN = "turn"
SHAPES = ("offset", "scale", TURN)  # of an error: u, diag(x) u, [x]x u of samples x
LEAST_S = 1.0  # of a span; what is shorter is noise or a spike
# The greatest gain, nats, of right flights of a window or two: the median of 112 (docs/model.md).
BY_CHANCE = 5.6
_CONTAMINATED = 0.25  # of windows none may have a gross error
_FEWEST = 5  # windows: a fault is in two that overlap, so that the median of five is none's
LIKELY = float(np.log(100.0))  # nats below the greatest: a hundredth as likely
_ROUNDING = 1e-6  # s, of times
_OPEN = 1e-6  # of G' G: what the states leave of it where they follow an offset


class Offset(NamedTuple):
    """The likeliest offset of a sensor: its span, size and covariance, and what it gains, nats.

    ``begins``, ``ends``: first and last keyframe of those where it may begin and end; ``span_s``:
    times, where they are known better.
    """

    sensor: str
    shape: str  # of ``SHAPES``; of measurements an offset
    begin: int  # keyframes
    end: int
    begins: tuple[int, int]
    ends: tuple[int, int]
    gain: float
    value: FloatArray  # (g,)
    covariance: FloatArray  # (g, g)
    span_s: tuple[float, float] | None = None

    def less(self, overdispersion: float) -> "Offset":
        """Return the same where residuals are overdispersed."""
        gain, covariance = self.gain / overdispersion, self.covariance * overdispersion
        return self._replace(gain=gain, covariance=covariance)


@dataclass(frozen=True, eq=False, slots=True)
class _Columns:
    """What a unit offset in each interval does: its gradient by the states, and its own terms."""

    sensor: str
    shape: str
    effect: FloatArray  # (n - 1, 2 D + b, g), J' G by both states and the constants
    squares: FloatArray  # (n - 1, g, g), G' G
    score: FloatArray  # (n - 1, g), G' y


def of_biases(problem: SmoothingProblem, solution: Solution) -> tuple[Offset, ...]:
    """Return the likeliest error of each of the inertial unit's sensors, of each shape.

    Parameters
    ----------
    problem : SmoothingProblem
        Without phases of arcs.
    solution : Solution
        Its minimum, with the covariances of its linearisation there.
    """
    return _of_record(_in_windows(problem.t_s, solution, _of_unit(problem, solution), LEAST_S))


def of_measurements(problem: SmoothingProblem, solution: Solution) -> tuple[Offset, ...]:
    """Return the likeliest offset of each measurement's residuals; parameters as above."""
    columns = _of_residuals(problem, solution)
    return _of_record(_in_windows(problem.t_s, solution, columns, LEAST_S, is_part=True))


def measurements_against_unit(
    problem: SmoothingProblem, solution: Solution, each_nats: float
) -> tuple[list[tuple[Offset, Offset]], float]:
    """Return the likeliest offset of any measurement in each window, and error of the unit there.

    And the overdispersion, by which gains are not divided here. Of a measurement a keyframe is
    enough, and ``each_nats`` are the odds against each in a span; parameters as above.
    """
    columns = _of_residuals(problem, solution), _of_unit(problem, solution)
    measured = _in_windows(problem.t_s, solution, columns[0], 0.0, each_nats, is_part=True)
    of_unit = _in_windows(problem.t_s, solution, columns[1], LEAST_S)
    pairs = zip(map(_greatest, measured), map(_greatest, of_unit), strict=True)
    return list(pairs), _overdispersion(measured, _CONTAMINATED)


def _of_unit(problem: SmoothingProblem, solution: Solution) -> list["_Columns"]:
    if not isinstance(problem.motion, Inertial):
        return []
    states, n = solution.states, len(problem.t_s)
    before, after = states.at(slice(0, n - 1)), states.at(slice(1, n))
    linear = problem.motion.linearise(before, after, np.arange(n - 1))
    J = np.concatenate([linear.before, linear.after, linear.shared], axis=2)
    columns = []
    for i, x in enumerate(_means(problem.motion, states)):
        bias = slice(AUX + 3 * i, AUX + 3 * i + 3)
        # A bias that is the same at both ends: the rows of its walk do not take part.
        G = linear.before[:, :, bias] + linear.after[:, :, bias]
        for shape, M in zip(SHAPES, _shapes(x), strict=True):
            columns.append(_columns((WHITE[i], shape), J, G @ M, -linear.value))
    return columns


def _of_residuals(problem: SmoothingProblem, solution: Solution) -> list["_Columns"]:
    states, n, D = solution.states, len(problem.t_s), problem.width
    columns = []
    for one in problem.measurements:
        linear = one.linearise(states.at(one.row), np.arange(len(one.row)))
        m, b = linear.value.shape[1], linear.shared.shape[2]
        # Of each interval what is measured as it begins, of the last what is as it ends, too.
        J, y = np.zeros((n - 1, 2, m, 2 * D + b)), np.zeros((n - 1, 2, m))
        G = np.zeros((n - 1, 2, m, m))
        end = (one.row == n - 1).astype(np.int64)
        at = (one.row - end, end)
        J[(*at, slice(None), slice(2 * D, None))] = linear.shared
        for i in (0, 1):
            J[one.row[end == i] - i, i, :, i * D : (i + 1) * D] = linear.state[end == i]
        y[at], G[at] = -linear.value, _of_a_unit(one.name, linear, states.R_nb[one.row])
        J, G, y = (x.reshape(n - 1, 2 * m, *x.shape[3:]) for x in (J, G, y))
        columns.append(_columns((one.name, SHAPES[0]), J, G, y))
    return columns


def _of_a_unit(name: str, linear: Linearised, R_nb: FloatArray) -> FloatArray:
    """Return what an offset by one of each axis adds to whitened residuals, (k, m, m).

    Of positions and velocities in n, of which it is what their states do; else of one sigma.
    """
    if name == "position":
        return -linear.state[:, :, POSITION] @ transpose(R_nb)
    if name == "velocity":
        return -linear.state[:, :, VELOCITY]
    return np.tile(np.eye(linear.value.shape[1]), (len(linear.value), 1, 1))


def _means(motion: Inertial, states: States) -> tuple[FloatArray, ...]:
    """Return specific force and rate of each interval, (n - 1, 3), less their biases."""
    imu, t_s, means = motion.imu, motion.t_s, []
    for i, x in enumerate((imu.f_b_mps2, motion.rates_of_unit_b_radps)):
        total = np.concatenate([np.zeros((1, 3)), x.cumsum(axis=0)])
        begin = np.searchsorted(imu.t_s, t_s, side="right").clip(0, len(x) - 1)
        first, last = begin[:-1], np.maximum(begin[1:], begin[:-1] + 1)
        mean = (total[last] - total[first]) / (last - first)[:, None]
        means.append(mean - states.aux[:-1, 3 * i : 3 * i + 3])
    return tuple(means)


def _shapes(x: FloatArray) -> tuple[FloatArray, ...]:
    """Return what each shape adds to samples x, (k, 3), by its three numbers, (k, 3, 3) each."""
    turn = np.stack([np.cross(x, axis) for axis in np.eye(3)], axis=2)
    return np.tile(np.eye(3), (len(x), 1, 1)), x[:, :, None] * np.eye(3), turn


def _columns(name: tuple[str, str], J: FloatArray, G: FloatArray, y: FloatArray) -> _Columns:
    return _Columns(
        *name,
        np.einsum("kmi,kmg->kig", J, G),
        np.einsum("kmg,kmh->kgh", G, G),
        np.einsum("kmg,km->kg", G, y),
    )


def _of_record(windows: list[list[Offset]]) -> tuple[Offset, ...]:
    """Return the likeliest offset of each among all windows."""
    spread = _overdispersion(windows, 0.5)
    return tuple(_greatest(list(ones)).less(spread) for ones in zip(*windows, strict=True))


def _greatest(offsets: list[Offset]) -> Offset:
    return max(offsets, key=lambda one: one.gain)


def _overdispersion(windows: list[list[Offset]], share: float) -> float:
    """Return by how much residuals leave more than chance, by the window that a share is below."""
    if len(windows) < _FEWEST or not windows[0]:
        return 1.0
    greatest = [_greatest(ones).gain for ones in windows]
    return max(float(np.quantile(greatest, share)) / BY_CHANCE, 1.0)


def _in_windows(
    t_s: FloatArray,
    solution: Solution,
    columns: list[_Columns],
    least_s: float,
    each_nats: float = 0.0,
    *,
    is_part: bool = False,
) -> list[list[Offset]]:
    """Return the likeliest offset of each among all spans of each window, ``least_s`` at least.

    ``is_part``: and none that is all of the record.
    """
    count = len(t_s) - 1
    most = count - is_part
    windows = []
    for k in range(0, max(1, count - _WINDOW // 2), _WINDOW // 2):
        window = slice(k, min(k + _WINDOW, count))
        shared = _shared(solution, [one.effect[window] for one in columns], window)
        windows.append(
            [
                _of_window(t_s, one, N, window, (least_s, most, each_nats))
                for one, N in zip(columns, shared, strict=True)
            ]
        )
    return windows


def _of_window(
    t_s: FloatArray,
    columns: _Columns,
    shared: FloatArray,
    window: slice,
    prior: tuple[float, int, float],
) -> Offset:
    """Return the likeliest offset of a window.

    ``shared`` is G' J P J' G, (w, g, w, g); ``prior``: how long a span is at least, s, and at most,
    in intervals, and the odds against each keyframe in it, nats.
    """
    least_s, most, each_nats = prior
    w, g = shared.shape[:2]
    N = -shared
    N[range(w), :, range(w)] += columns.squares[window]
    total = np.zeros((w + 1, w + 1, g, g))
    total[1:, 1:] = N.transpose(0, 2, 1, 3).cumsum(axis=0).cumsum(axis=1)
    sums = np.concatenate([np.zeros((1, g)), columns.score[window].cumsum(axis=0)])
    squares = columns.squares[window].trace(axis1=1, axis2=2)
    sizes = np.concatenate([[0.0], squares.cumsum()])
    begin, end = np.triu_indices(w + 1, 1)
    times_s = t_s[window.start : window.stop + 1]
    valid = (times_s[end] - times_s[begin] > least_s - _ROUNDING) & (end - begin <= most)
    begin, end = begin[valid], end[valid]
    if len(begin) == 0:
        return Offset(
            columns.sensor, columns.shape, 0, 0, (0, 0), (0, 0), 0.0, np.zeros(g), np.eye(g)
        )
    s = sums[end] - sums[begin]
    of_span = total[end, end] - total[begin, end] - total[end, begin] + total[begin, begin]
    size = (sizes[end] - sizes[begin]).clip(1e-300)
    least = np.linalg.eigvalsh(of_span)[:, 0] / size
    # No information is negative: what is shows how much of it rounding is.
    floor = (_OPEN + max(-float(least.min()), 0.0)) * size
    of_span = of_span + floor[:, None, None] * np.eye(g)
    value = np.linalg.solve(of_span, s[:, :, None])[:, :, 0]
    gains = np.where(least > -_OPEN, (s * value).sum(axis=1) / 2, 0.0)
    counts = np.concatenate([[0], np.cumsum(squares > 0)])
    posterior = gains - each_nats * (counts[end] - counts[begin])
    i = int(posterior.argmax())
    likely = posterior > posterior[i] - LIKELY
    begin, end = begin + window.start, end + window.start
    return Offset(
        columns.sensor,
        columns.shape,
        int(begin[i]),
        int(end[i]),
        (int(begin[likely].min()), int(begin[likely].max())),
        (int(end[likely].min()), int(end[likely].max())),
        float(gains[i]),
        value[i],
        np.linalg.inv(of_span[i]),
    )


def _shared(solution: Solution, effects: list[FloatArray], window: slice) -> list[FloatArray]:
    """Return what states and constants share of each, G' J P J' G between intervals.

    Of a chain the covariance of distant states follows from that of neighbours: what is known of
    state k given the next and the constants does not depend on those after.
    """
    D, b = solution.covariance.shape[1], solution.constant_cross.shape[2]
    counts = [one.shape[2] for one in effects]
    places = np.split(np.arange(sum(counts)), np.cumsum(counts)[:-1])
    effect = np.concatenate(effects, axis=2)
    w, g = len(effect), effect.shape[2]
    out = [np.zeros((w, m, w, m)) for m in counts]
    later = np.zeros((D + b, w, g))  # covariance of (next state, constants) by offsets after it
    for k in reversed(range(w)):
        P = _of_neighbours(solution, window.start + k, D, b)
        F, E = _regression(P, D), effect[k]
        led, past = P @ E, E[D:] + F.T @ E[:D]
        for one, at in zip(out, places, strict=True):
            one[k, :, k] = E[:, at].T @ led[:, at]
            cross = np.tensordot(past[:, at], later[:, k + 1 :][:, :, at], (0, 0))
            one[k, :, k + 1 :] = cross
            one[k + 1 :, :, k] = cross.transpose(1, 2, 0)
        later[:D] = np.tensordot(F, later, (1, 0))
        later[:D, k], later[D:, k] = led[:D], led[2 * D :]
    return out


def _of_neighbours(solution: Solution, k: int, D: int, b: int) -> FloatArray:
    """Return the covariance of states k and k + 1 and of the constants."""
    if solution.cross is None:
        raise ValueError("solution: needs covariances of neighbours")
    P = np.empty((2 * D + b, 2 * D + b))
    P[:D, :D], P[D : 2 * D, D : 2 * D] = solution.covariance[k], solution.covariance[k + 1]
    P[:D, D : 2 * D], P[D : 2 * D, :D] = solution.cross[k], solution.cross[k].T
    for at, row in ((slice(0, D), k), (slice(D, 2 * D), k + 1)):
        P[at, 2 * D :] = solution.constant_cross[row]
        P[2 * D :, at] = solution.constant_cross[row].T
    P[2 * D :, 2 * D :] = solution.constant_covariance[k]
    return P


def _regression(P: FloatArray, D: int) -> FloatArray:
    """Return the derivative of a state's mean by the next one and the constants, (D, D + b)."""
    sigma = np.sqrt(P.diagonal())
    C = P / np.outer(sigma, sigma)
    F = np.linalg.solve(C[D:, D:], C[D:, :D]).T
    return np.asarray(F * sigma[:D, None] / sigma[D:])

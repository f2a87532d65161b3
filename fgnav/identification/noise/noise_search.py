"""The likeliest noises of a flight: noise at states, and states at noise, in turn."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.frontend.sensors.rest import AT_REST
from fgnav.graph.correlation import correlated
from fgnav.graph.types.motion import INERTIAL_NOISES
from fgnav.identification.likelihood.linear_chain import LinearChain, Score
from fgnav.identification.likelihood.search import Found, search
from fgnav.identification.noise.begin import ABOVE, WHITE, begins, widened
from fgnav.identification.noise.identified import TOLERATED, Identified, contradicted
from fgnav.identification.noise.stated import INSTRUMENTS
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.solve.chain import solve_batch

# Log-normal sigmas of what nobody stated: white noise of small units in motion is 1 to 40 times
# the figures of their data sheets (docs/model.md), walks are known by their order.
_WHITE_SIGMA, _WALK_SIGMA = np.log(5.0), np.log(10.0)
# Of what is stated while it is tested: as good as nothing.
TEST_SIGMA = np.log(30.0)
ITERATIONS = 10  # steps of Gauss-Newton
_ROUNDS = 20  # of noise at states, and states at noise
_ALIKE = 0.5  # correlation of neighbours whose errors are more of what stays than of noise


def searched(flight: ThinnedFlight, factors: dict[str, float]) -> Identified:
    """Return the likeliest noises, begun ever louder until there are any.

    Linearised about what a faulty sensor draws the states to, a chain has no minimum.

    Parameters
    ----------
    flight : ThinnedFlight
    factors : dict of str to float
        On noises, to begin with.
    """
    *first, last = begins(flight.problem, factors)
    for one in first:
        try:
            return _searched_from(flight, *one)
        except NoSolutionError:
            continue
    return _searched_from(flight, *last)


def _searched_from(flight: ThinnedFlight, factors: dict[str, float], louder: float) -> Identified:
    """Return the likeliest noises: all free at first, then those that are not believed alone."""
    states, above = flight.problem.start, dict.fromkeys(WHITE, ABOVE * louder)
    if "gyroscope" not in flight.parts.names:
        begun = widened(flight.problem, factors, louder)
        states, above = solve_batch(begun, most=ITERATIONS).states, dict.fromkeys(WHITE, louder)
    loud = above | factors
    theta = flight.logarithms({n + AT_REST: factor for n, factor in loud.items()} | loud)
    in_motion = np.isin(flight.names, INERTIAL_NOISES)
    is_stated, share, last = flight.is_stated, 1.0, np.zeros(len(theta))
    for _ in range(_ROUNDS):
        chain, states, _ = flight.descended(states, theta, ITERATIONS)
        free = _free(chain, theta, is_stated)
        change = free.theta - theta
        if np.abs(change)[in_motion].max() < TOLERATED:
            break
        if change @ last < 0.0:
            share /= 2  # noise and states undo each other's changes
        theta, last = theta + share * change, change
    else:
        raise NoSolutionError("noise: it is another at every linearisation of the chain")
    likeliest, theta, used = _beside_the_stated(chain, free, is_stated)
    theta, used = louder_by_correlation(chain, likeliest.score, theta, used)
    theta, used = _completed(chain.names, free, theta, used, is_stated)
    mean, sigma = _prior(chain.names, is_stated)
    penalty = float((((likeliest.theta - mean) / sigma) ** 2).sum()) / 2
    return flight.identified(
        states,
        likeliest.score,
        (np.exp(theta), likeliest.sigma, used),
        likeliest.score.log_likelihood - penalty,
    )


def _prior(names: tuple[str, ...], is_stated: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and sigma of theta: usual figures are where it is zero."""
    return np.zeros(len(names)), np.where(is_stated, TEST_SIGMA, figure_sigmas(names))


def figure_sigmas(names: tuple[str, ...]) -> FloatArray:
    """Return 1-sigmas of theta, (c,), of components that nobody stated, about usual figures."""
    is_walk = np.array([name.endswith("bias") for name in names])
    return np.asarray(np.where(is_walk, _WALK_SIGMA, _WHITE_SIGMA))


def _free(chain: LinearChain, begin: FloatArray, is_stated: BoolArray) -> Found:
    """Return the likeliest noises.

    Of positions that repeat, and of instruments, none that is less than stated.
    """
    prior, everything = _prior(chain.names, is_stated), np.ones(len(begin), dtype=np.bool_)
    position = is_stated & (np.array(chain.names) == "position")
    instrument = is_stated & np.isin(chain.names, INSTRUMENTS)
    likeliest = search(
        chain, begin, everything, prior, np.where(position | instrument, 0.0, -np.inf)
    )
    if (
        likeliest is not None
        and (position & (likeliest.theta == 0.0)).any()
        and not _err_alike(chain, likeliest.score)
    ):
        least = np.where(instrument, 0.0, -np.inf)
        likeliest = search(chain, likeliest.theta, everything, prior, least)
    if likeliest is None:
        raise NoSolutionError("noise: the chain has no solution about which to identify it")
    return likeliest


def _completed(
    names: tuple[str, ...], free: Found, theta: FloatArray, used: BoolArray, is_stated: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return theta, and what is used, of noises at rest and in motion that are not identified.

    What contradicts neither what is stated nor the other of the two is as loud as that, or as
    stated if that is more. Errors of a receiver's positions stay where it does: that they repeat at
    rest makes them no smaller.
    """
    theta, used = theta.copy(), used.copy()
    for resting in (i for i, name in enumerate(names) if name.endswith(AT_REST)):
        moving = names.index(names[resting].removesuffix(AT_REST))
        pair = [moving, resting]
        differs = contradicted(np.diff(free.theta[pair]), np.hypot(*free.sigma[pair]))[0]
        for one, other in (pair, pair[::-1]):
            if not (used[one] or differs) and used[other] and theta[other] > 0.0:
                theta[one], used[one] = theta[other], True
        if names[moving] == "position":
            least = 0.0 if is_stated[moving] else theta[moving]
            theta[resting] = max(theta[resting], least)
            used[resting] &= theta[resting] != 0.0
    return theta, used


def _err_alike(chain: LinearChain, score: Score) -> bool:
    """Return whether positions agree better than stated because neighbours err alike.

    What stays with a receiver's positions for minutes is in their sigmas: that neighbours repeat to
    centimetres does not contradict metres.
    """
    r = chain.residuals("position", score)
    return bool((r[1:] * r[:-1]).sum() > _ALIKE * (r**2).sum())


def _beside_the_stated(
    chain: LinearChain, free: Found, is_stated: BoolArray
) -> tuple[Found, FloatArray, BoolArray]:
    """Return the search with all as stated that is not contradicted, theta, and what is not.

    Of noises contradicted together each must be so beside the others alone.
    """
    theta, used = free.theta, ~is_stated | contradicted(free.theta, free.sigma)
    while used.any() and not used.all():
        begin = np.where(used, theta, 0.0)
        again = search(chain, begin, used, _prior(chain.names, is_stated))
        if again is None:
            break
        still = used & (~is_stated | contradicted(again.theta, again.sigma))
        if (still == used).all():
            return again, np.where(used, again.theta, theta), used
        used = still
    return free, theta, used


def louder_by_correlation(
    chain: LinearChain, score: Score, theta: FloatArray, used: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return theta and what is used, with instruments whose errors stay for many samples.

    White noise that is as loud at low frequencies has ``1 + 2 sum(rho)`` times the variance.
    """
    louder = theta.copy()
    for i in np.flatnonzero(np.isin(chain.names, INSTRUMENTS)):
        louder[i] += np.log(correlated(chain.residuals(chain.names[i], score))) / 2
    longer = (louder > theta) & (louder > TOLERATED)
    return np.where(longer, louder, theta), used | longer

"""Flights without integers and gyroscope, whose heading only later motion tells.

What windows and batch need there beside what all flights do.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from fgnav.checks import NoSolutionError
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.collect import Collected
from fgnav.methods.smoother.constants import LINEAR
from fgnav.methods.smoother.constants_found import started_there
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.quick_rates import with_quick_rates
from fgnav.methods.smoother.solution import Solution, started_at

Solve = Callable[..., Solution]  # of keyframes


def is_blind(collected: Collected) -> bool:
    """Return whether neither an array nor a gyroscope tells how the body turns."""
    imu = collected.keyframes.preintegrate.imu
    return collected.integers is None and imu.w_b_radps is None


def quickened(collected: Collected) -> Collected:
    """Return keyframes that know of rates which come and go between fixes, where nothing else does.

    They start where they did: on a real flight the search went on from there to a lower cost than
    from where the stiffer motion had led.
    """
    if not (collected.rough and is_blind(collected)):
        return collected
    try:
        found = solve_batch(collected.keyframes)
        if not found.converged:
            return collected
        keyframes = with_quick_rates(collected.keyframes, found)
    except NoSolutionError:  # the method itself will say so
        return collected
    return replace(collected, keyframes=keyframes)


def linearised(collected: Collected, solve: Solve, *, ahead: bool) -> tuple[Collected, Solve]:
    """Linearise at the batch what a window cannot linearise anew once it has left.

    Constants; and all states where later motion alone tells the heading: of 30 flights of 30 s
    without phase, the window's attitudes erred by 267 sigmas squared (median; 3 is right) where it
    linearised them itself, by 1.6 so.

    Parameters
    ----------
    collected : Collected
    solve : callable
        A window's; it takes ``anew``.
    ahead : bool
        Whether it is a filter, which is not to know what is ahead.
    """
    keyframes = collected.keyframes
    curved = any(one.place not in LINEAR for one in keyframes.constants)
    later = is_blind(collected) and not ahead
    if not (curved or later):
        return collected, solve
    found = solve_batch(keyframes)
    keyframes = started_there(keyframes, found)
    if later and found.converged:
        keyframes, solve = started_at(keyframes, found), partial(solve, anew=False)
    return replace(collected, keyframes=keyframes), solve


def naming(name: str, collected: Collected, solve: Solve) -> Solve:
    """Return a solver that says what a window is lost by: attitudes that nothing but a start tells.

    It cannot linearise what has left it anew; the batch can.
    """
    if not is_blind(collected) or collected.keyframes.gravity is not None:
        return solve

    def named(keyframes: Keyframes) -> Solution:
        try:
            return solve(keyframes)
        except NoSolutionError as error:
            raise NoSolutionError(
                f"attitude: without an array, a gyroscope or gravity directions {name} lost "
                f"it, the batch may not: {error}"
            ) from error

    return named

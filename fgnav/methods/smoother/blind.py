"""Flights without integers, whose heading only later motion tells.

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
from fgnav.methods.smoother.observability import TURN
from fgnav.methods.smoother.quick_rates import with_quick_rates
from fgnav.methods.smoother.residuals import residuals
from fgnav.methods.smoother.solution import Solution, started_at

# Times what noise explains. Of wrong minima, spins lost or a body that was not nose first, costs
# were 1.6 to 2600 times that, of right ones 0.9 to 1.3.
_MISFIT = 1.5

Solve = Callable[..., Solution]  # of keyframes


def is_blind(collected: Collected) -> bool:
    """Return whether neither an array nor a gyroscope tells how the body turns."""
    imu = collected.keyframes.preintegrate.imu
    return collected.integers is None and imu.w_b_radps is None


def quickened(collected: Collected, *, ahead: bool) -> Collected:
    """Return keyframes that know of rates which come and go between fixes, where nothing else does.

    The intensity is told about where motion without it leads, even if that is no minimum: of a spin
    whose nose wobbles, there is none near the truth. The search starts where it did: on a real
    flight it went on from there to a lower cost than from where the stiffer motion had led.

    Parameters
    ----------
    collected : Collected
    ahead : bool
        Whether it is for a filter. Where vectors tell attitudes well, their intensity is told as a
        smoother needs it; the likelihood is a filter's own measure.
    """
    if not is_blind(collected) or not (collected.rough or ahead):
        return collected
    try:
        keyframes = with_quick_rates(collected.keyframes, solve_batch(collected.keyframes))
    except NoSolutionError:  # the method itself will say so
        return collected
    return replace(collected, keyframes=keyframes)


def linearised(collected: Collected, solve: Solve, *, ahead: bool) -> tuple[Collected, Solve]:
    """Linearise where the flight is known what a window cannot linearise anew once it has left.

    At the batch constants; and all states where later motion alone tells the heading: of 30 flights
    of 30 s without phase, the window's attitudes erred by 267 sigmas squared (median; 3 is right)
    where it linearised them itself, by 1.6 so. A filter is not to know what is ahead: its states
    are linearised where each epoch's own vectors have them, 73 and 1.6.

    Parameters
    ----------
    collected : Collected
    solve : callable
        A window's; it takes ``anew``.
    ahead : bool
        Whether it is a filter's.
    """
    keyframes = collected.keyframes
    curved = any(one.place not in LINEAR for one in keyframes.constants)
    later = is_blind(collected) and not ahead
    if is_blind(collected) and ahead and collected.rough:
        solve = partial(solve, anew=False)
    if not (curved or later):
        return collected, solve
    found = fitting(collected, solve_batch)(keyframes)
    if later and collected.rough and not found.converged:
        raise NoSolutionError(
            f"attitude: the {TURN} is left open: the batch, where windows are linearised, ends in "
            "no minimum that explains the measurements; gravity directions would tell it"
        )
    keyframes = started_there(keyframes, found)
    if later and found.converged:
        keyframes, solve = started_at(keyframes, found), partial(solve, anew=False)
    return replace(collected, keyframes=keyframes), solve


def fitting(collected: Collected, solve: Solve) -> Solve:
    """Return a solver whose minima count only where they explain what was measured.

    Where the search starts from attitudes that assume something, it may end anywhere.
    """
    if not collected.rough:
        return solve

    def fitted(keyframes: Keyframes) -> Solution:
        found = solve(keyframes)
        lost = found.cost > _MISFIT * count(keyframes, found)
        return replace(found, converged=found.converged and not lost)

    return fitted


def count(keyframes: Keyframes, solution: Solution) -> int:
    """Return how many values were measured; of an array, next to nothing where start is rough."""
    parts = residuals(keyframes, solution)
    return sum(int(part.freedom.sum()) for part in parts if part.what != "array phases")


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

"""Custom factors: which keyframe each enters with, and what is refused."""

from collections import defaultdict
from collections.abc import Sequence
from typing import TypeAlias

import gtsam

from fgnav.checks import BadInputError
from fgnav.graph import keys
from fgnav.graph.build import Layout, flight_values
from fgnav.graph.custom import NamedFactor, check_factor, named
from fgnav.graph.residual_model import spelt
from fgnav.graph.types.problem import Problem

Custom: TypeAlias = gtsam.NonlinearFactor | NamedFactor


class CustomFactors:
    """Custom factors by the last keyframe that each touches.

    Parameters
    ----------
    custom : sequence of gtsam.NonlinearFactor or NamedFactor
        Keyframe numbers in their keys are rows of the problem.
    problem : Problem

    Raises
    ------
    BadInputError
        If one touches a variable that the flight has not, or cannot be evaluated.
    """

    def __init__(self, custom: Sequence[Custom], problem: Problem) -> None:
        self._problem, layout = problem, Layout.of(problem)
        constants, factors = set(layout.constant_keys), [named(source) for source in custom]
        self._at: dict[int, list[tuple[int, NamedFactor]]] = defaultdict(list)
        for factor in factors:
            involved, last = list(factor.factor.keys()), len(problem.t_s) - 1
            rows = [
                _keyframe(factor, key, layout, last) for key in involved if key not in constants
            ]
            self._at[max(rows, default=0)].append((min(rows, default=0), factor))
        native = [each for each in factors if each.model is None]  # the others check themselves
        values = flight_values(problem, problem.start) if native else gtsam.Values()
        for factor in native:
            check_factor(factor, values)

    @property
    def factors(self) -> list[gtsam.NonlinearFactor]:
        """Return all of them."""
        return [factor.factor for factors in self._at.values() for _, factor in factors]

    def within(self, span_s: float) -> list[Custom]:
        """Return those whose keyframes are at most that far apart."""
        t_s = self._problem.t_s
        return [
            factor
            for row, factors in self._at.items()
            for first, factor in factors
            if t_s[row] - t_s[first] <= span_s
        ]

    def at(self, row: int, oldest: int) -> list[gtsam.NonlinearFactor]:
        """Return those that enter with a keyframe.

        Raises
        ------
        BadInputError
            If one reaches further back than the window's oldest keyframe.
        """
        factors = self._at.get(row, [])
        for first, factor in factors:
            if first < oldest:
                t_s = self._problem.t_s
                raise BadInputError(
                    f"factor {factor.name!r}: joins keyframes {t_s[row] - t_s[first]:.2f} s apart, "
                    f"{t_s[first]:.2f} and {t_s[row]:.2f} s, further than the window reaches; use "
                    "a longer lag or the batch"
                )
        return [factor.factor for _, factor in factors]


def touches_newest(factor: NamedFactor, layout: Layout, oldest: int, newest: int) -> bool:
    """Return True if a factor enters with the newest keyframe, which it touches then.

    Raises
    ------
    BadInputError
        If it touches a variable that the stream has not, or one that has left the window.
    """
    involved, constants = list(factor.factor.keys()), set(layout.constant_keys)
    rows = [_keyframe(factor, key, layout, newest) for key in involved if key not in constants]
    if max(rows, default=-1) < newest:
        return False
    if min(rows) < oldest:
        raise BadInputError(
            f"factor {factor.name!r}: touches keyframe {min(rows)}, which has left the window; its "
            f"oldest is {oldest}"
        )
    return True


def _keyframe(factor: NamedFactor, key: int, layout: Layout, newest: int) -> int:
    """Return the keyframe of a variable."""
    k = keys.index(key)
    if k > newest or key not in layout.keyframe(k):
        raise BadInputError(
            f"factor {factor.name!r}: {spelt(key)} is no variable of the flight, which has "
            f"keyframes 0 to {newest} of pose, velocity and "
            f"{'imu_bias' if layout.gyroscope else 'angular_motion'}, and "
            f"{len(layout.constant_keys)} constants"
        )
    return k

"""Custom factors that alone determine the heading: where the search starts.

Turned about down by an angle psi, a body at keyframe k has the tangent ``R_nb' e3 psi``. A factor
of Jacobian J, whitened, determines that angle with the 1-sigma ``1 / |J R_nb' e3|``.
"""

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np

from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp
from fgnav.graph import keys
from fgnav.graph.build import Layout, insert_constants, insert_keyframe
from fgnav.graph.custom import NamedFactor
from fgnav.graph.types.problem import ROTATION_PRIOR_RAD, AttitudePrior, Problem

_DETERMINED_RAD = np.radians(15.0)  # 1-sigma at most: sin x = x within 1.2 %
_HEADINGS = 36  # tried: one is within 5 degrees of the best


def with_custom_heading(prepared: PreparedFlight, custom: Sequence[NamedFactor]) -> PreparedFlight:
    """Return a flight whose heading is known from where custom factors determine it.

    The search starts where those so far have the heading, carried back to the first keyframe as
    the opening has the body turn; the first attitude is as unknown as before. A flight whose
    heading is known earlier, or is not determined well enough, is returned as it is.

    Parameters
    ----------
    prepared : PreparedFlight
    custom : sequence of NamedFactor
        Numbers in their keys are rows of the problem.
    """
    opening = prepared.opening
    if opening is None:
        return prepared
    first: dict[int, NamedFactor] = {}
    for factor in custom:
        involved = list(factor.factor.keys())
        if len(involved) == 1 and keys.letter(involved[0]) == "x":
            first.setdefault(keys.index(involved[0]), factor)
    begun = replace(prepared.problem, start=opening.problem.start)
    turned, information = 0.0 + 0.0j, 0.0
    for k in sorted(first):
        correction = _heading_correction(begun, first[k], k)
        if correction is None:
            continue
        if prepared.problem.t_s[k] >= opening.until_s:
            break
        turned, information = (
            turned + correction[1] * np.exp(1j * correction[0]),
            information + correction[1],
        )
        if information * _DETERMINED_RAD**2 > 1:
            return _turned(prepared, float(np.angle(turned)), float(prepared.problem.t_s[k]))
    return prepared


def _turned(prepared: PreparedFlight, turn_rad: float, from_s: float) -> PreparedFlight:
    """Return the flight, its search turned about down, its heading known from a time on."""
    opening = prepared.opening
    if opening is None:
        return prepared
    start = opening.problem.start
    R_nb = _about_down(turn_rad) @ start.R_nb
    start = start._replace(R_nb=R_nb)
    P = opening.problem.attitude_prior
    level = np.eye(3) * ROTATION_PRIOR_RAD**2 if P is None else P.covariance_rad2
    # What the opening knows of the level, and nothing of the heading.
    down_b = R_nb[0, 2]
    across = np.eye(3) - np.outer(down_b, down_b)
    prior = AttitudePrior(
        R_nb=R_nb[0],
        covariance_rad2=across @ level @ across + ROTATION_PRIOR_RAD**2 * np.outer(down_b, down_b),
    )
    aligned = prepared.problem if opening.aligned is None else opening.aligned
    return replace(
        prepared,
        problem=replace(aligned, start=start, attitude_prior=prior),
        opening=None if from_s <= prepared.problem.t_s[0] else replace(opening, until_s=from_s),
    )


def _heading_correction(
    problem: Problem, factor: NamedFactor, k: int
) -> tuple[float, float] | None:
    """Return by how much a factor wants keyframe k turned about down, and its information.

    None if it has too little.
    """
    tried = np.linspace(0, 2 * np.pi, _HEADINGS, endpoint=False)
    errors = [factor.factor.error(_at(problem, k, turn_rad)) for turn_rad in tried]
    best = float(tried[int(np.argmin(errors))])
    J, minus_r = factor.factor.linearize(_at(problem, k, best)).jacobian()
    by_turn = J[:, :3] @ problem.start.R_nb[k, 2]
    information = float(by_turn @ by_turn)
    if information * _DETERMINED_RAD**2 < 1:
        return None
    return best + float(by_turn @ minus_r) / information, information


def _at(problem: Problem, k: int, turn_rad: float) -> gtsam.Values:
    """Return a keyframe turned about down, and the constants, where the search starts."""
    layout, values, start = Layout.of(problem), gtsam.Values(), problem.start
    insert_constants(values, layout, start.constants)
    here = start.at(slice(k, k + 1))
    insert_keyframe(values, layout, k, here._replace(R_nb=_about_down(turn_rad) @ here.R_nb))
    return values


def _about_down(turn_rad: float) -> FloatArray:
    return np.asarray(exp(np.array([[0.0, 0.0, turn_rad]]))[0])

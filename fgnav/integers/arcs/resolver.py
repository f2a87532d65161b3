"""Integers over arcs: constant from slip to slip, so every epoch of an arc helps to find them.

Code is smoothed by phase over each arc before anything is searched, as far as the correlation of
its noise allows. The inner resolver then resolves epoch by epoch, and the epoch of an arc that is
surest speaks for all of it; a satellite that joins is searched together with those that were there,
whose smoothed code holds the array where it is.

Its chance to be wrong goes along with an integer: the geometric mean of what the epochs say of it,
as if all of them shared their noise, or as many times the surest one's as there are epochs to
choose from; and more where another epoch speaks against it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fgnav.checks import BadInputError, IntArray, NoSolutionError
from fgnav.gnss.cycle_slips.detection import phase_arcs
from fgnav.gnss.single_differences import single_differences
from fgnav.integers.acceptance import HANDED_OVER, WITHOUT_CODE, not_fixed, phase_links
from fgnav.integers.arcs.carried import Answers, carry, chance_of_epochs
from fgnav.integers.arcs.smoothing import smoothed
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, Resolver

_WRONG_MAX = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Arcs:
    """Let an inner resolver see smoothed code, and carry its integers along the arcs.

    Attributes
    ----------
    inner : Resolver
        Must state ``wrong_probability``; best without thresholds of its own.
    wrong_max : float
        Epochs keep the links whose integers, all together, are wrong with at most this probability.
    correlation_s : float or None
        Correlation time of code noise; None measures it.
    prepare : callable or None
        Applied to the differences first, such as to find out how large their noise is.
    causal : bool
        Each epoch by epochs up to it alone: code is not smoothed, and an arc has the integer of its
        surest epoch so far. ``inner`` and ``prepare`` must be causal as well.
    """

    inner: Resolver
    wrong_max: float = _WRONG_MAX
    correlation_s: float | None = None
    prepare: Callable[[DoubleDifferences], DoubleDifferences] | None = None
    causal: bool = False

    def __post_init__(self) -> None:
        """Reject what is no probability and what is no time."""
        if not 0.0 < self.wrong_max < 1.0:
            raise BadInputError(f"wrong_max: must be between 0 and 1, got {self.wrong_max}")
        if self.correlation_s is not None and not self.correlation_s > 0.0:
            raise BadInputError(
                f"correlation_s: must be positive, or None, got {self.correlation_s}"
            )

    @property
    def name(self) -> str:
        """Return the name the command line knows."""
        return f"{self.inner.name}-arcs"

    @property
    def looks_ahead(self) -> bool:
        """Return True if code is smoothed over whole arcs, whose surest epoch speaks for all."""
        return not self.causal

    def causal_form(self, inner: Resolver) -> "Arcs":
        """Return the resolver by the past alone, with an inner resolver that is causal.

        Raises
        ------
        BadInputError
            If nothing is known of ``prepare`` but that it is given all epochs.
        """
        if self.prepare not in (None, noise_as_shown):
            raise BadInputError(
                f"integers {self.name!r}: what 'prepare' makes of an epoch may depend on later "
                "ones; for causal integers take 'constrained' or 'lambda'"
            )
        prepare = _NOISE_SO_FAR if self.prepare else None
        return replace(self, inner=inner, prepare=prepare, causal=True)

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every link of phase whose arc has code.

        Raises
        ------
        BadInputError
            If the inner resolver does not say how likely its integers are wrong.
        """
        arc = link_arcs(differences, flight, causal=self.causal)
        smooth = self.prepare(differences) if self.prepare else differences
        if not self.causal:
            smooth = smoothed(smooth, arc, self.correlation_s).differences
        answer = self.inner(smooth, flight)
        if answer.wrong_probability is None:
            raise BadInputError(
                f"integers '{self.name}': '{answer.resolver}' does not say how likely its "
                "integers are wrong; take one that does, such as 'lambda' or 'constrained'"
            )
        of_reference = np.ascontiguousarray(differences.reference[:, differences.group])
        resolved = answer.fixed | (differences.is_reference[:, None] & (differences.phase_m == 0))
        answers = Answers(answer.cycles, resolved, answer.wrong_probability, arc, of_reference)
        arc_integers = carry(answers, causal=self.causal)
        links = phase_links(differences) & (of_reference >= 0)[:, None]
        answered = links & (arc_integers.source >= 0)
        chance, sources = chance_of_epochs(arc_integers, answered)
        sure = answered & (arc_integers.chance * sources[:, None, None] <= self.wrong_max)
        reasons = {
            WITHOUT_CODE: phase_links(differences) & ~np.isfinite(smooth.code_m),
            "no epoch of the arc could be resolved": links & np.isfinite(smooth.code_m) & ~answered,
            f"probability of wrong integers above {self.wrong_max:g}": answered & ~sure,
        }
        handed_over = (entry for entry in answer.unused if entry.what == HANDED_OVER)
        return Integers(
            resolver=self.name,
            cycles=np.where(sure, arc_integers.cycles, 0),
            fixed=sure,
            ratio=answer.ratio,
            wrong_probability=np.where(answered.any(axis=(1, 2)), chance, 1.0),
            unused=(*handed_over, *not_fixed(reasons)),
        )


def lambda_arcs() -> Arcs:
    """Integer least squares, one integer from slip to slip."""
    from fgnav.integers.resolvers.lambda_ import Lambda  # noqa: PLC0415  # each brings its own kernels

    return Arcs(inner=Lambda(success_min=1.0 - 0.25 * _WRONG_MAX), prepare=noise_as_shown)


def constrained_arcs() -> Arcs:
    """Integer least squares under the array's known shape, one integer from slip to slip."""
    from fgnav.integers.resolvers.constrained import Constrained  # noqa: PLC0415

    inner = Constrained(wrong_max=None, estimate_noise=False)
    return Arcs(inner=inner, prepare=noise_as_shown)


def noise_as_shown(differences: DoubleDifferences, *, causal: bool = False) -> DoubleDifferences:
    """Return differences whose variances are those that the rigid array shows, epoch by epoch.

    Causal: each epoch's by epochs up to it alone.
    """
    from fgnav.integers.array.noise import with_estimated_noise  # noqa: PLC0415
    from fgnav.integers.resolvers.constrained import Constrained  # noqa: PLC0415

    return with_estimated_noise(differences, Constrained().nodes, causal=causal)


_NOISE_SO_FAR = partial(noise_as_shown, causal=True)  # one object: resolvers with it are alike


def link_arcs(differences: DoubleDifferences, flight: Flight, *, causal: bool = False) -> IntArray:
    """Return numbers, (n, b, m), that change where a single difference's integer may; -1 without.

    Those of the double differences, which a change of reference ends, where the flight's own
    observations are not what they come from.
    """
    try:
        single = single_differences(flight, causal=causal)
    except NoSolutionError:
        return differences.arc
    if single.phase_m.shape != differences.phase_m.shape:
        return differences.arc
    names = tuple(antenna.name for antenna in flight.antennas)
    arc = phase_arcs(single, names, causal=causal).arc.astype(int)
    both = arc[:, :1] * (arc.max(initial=0) + 1) + arc[:, 1:]
    answered = (arc[:, :1] >= 0) & (arc[:, 1:] >= 0) & np.isfinite(single.phase_m)
    return np.asarray(np.where(answered, both, -1))

"""Resolvers that use the past only: what a filter may ask at the time of an epoch."""

from collections import Counter
from dataclasses import dataclass, is_dataclass, replace

import numpy as np

from fgnav.checks import losses_of
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, Resolver


@dataclass(frozen=True, slots=True)
class EpochByEpoch:
    """A resolver that is asked for each epoch as if the flight had no other.

    Attributes
    ----------
    resolver : Resolver
        One that may look ahead, or does not state whether it does.
    """

    resolver: Resolver
    looks_ahead = False

    @property
    def name(self) -> str:
        """Return the resolver's own name."""
        return self.resolver.name

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve each epoch alone."""
        n = len(differences.t_s)
        parts = [self.resolver(differences.resampled(np.array([k])), flight) for k in range(n)]
        if not parts:
            return self.resolver(differences, flight)
        wrong = [one.wrong_probability for one in parts]
        reasons = [one.reasons for one in parts]
        lost: Counter[tuple[str, str]] = Counter()
        for one in parts:
            for loss in one.losses:
                lost[loss.what, loss.reason] += loss.count
        return Integers(
            resolver=self.name,
            cycles=np.concatenate([one.cycles for one in parts]),
            fixed=np.concatenate([one.fixed for one in parts]),
            ratio=np.concatenate([one.ratio for one in parts]),
            wrong_probability=(
                None
                if any(p is None for p in wrong)
                else np.concatenate([p for p in wrong if p is not None])
            ),
            reasons=(
                None
                if any(r is None for r in reasons)
                else tuple(text for r in reasons if r is not None for text in r)
            ),
            losses=losses_of(lost),
        )


def looks_ahead(resolver: Resolver) -> bool:
    """Return whether a resolver may use later epochs; true of one that does not state it."""
    return bool(getattr(resolver, "looks_ahead", True))


def causal_form(resolver: Resolver) -> Resolver:
    """Return a resolver that resolves each epoch by epochs up to it alone.

    One that looks at single epochs is its own causal form. One with a field ``causal``, such as
    ``Constrained``, learns the noise from epochs before, and keeps the share of wrong epochs as if
    the flight ended with each. ``Arcs`` do without smoothed code, and carry the integers of the
    surest epoch so far.

    Any other that may look ahead is asked epoch by epoch.
    """
    from fgnav.integers.arcs.resolver import Arcs  # noqa: PLC0415  # brings its own kernels

    if not looks_ahead(resolver):
        return resolver
    if isinstance(resolver, Arcs):
        return resolver.causal_form(causal_form(resolver.inner))
    if is_dataclass(resolver) and hasattr(resolver, "causal"):
        return replace(resolver, causal=True)
    return EpochByEpoch(resolver)

"""Resolvers that use the past only: what a filter may ask at the time of an epoch."""

from dataclasses import dataclass, is_dataclass, replace

import numpy as np

from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, Resolver, joined


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
        return joined(self.name, parts) if parts else self.resolver(differences, flight)


def looks_ahead(resolver: Resolver) -> bool:
    """Return True if a resolver may use later epochs, or does not state it."""
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

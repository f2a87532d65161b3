"""A real pair whose resolver accepts everything: what its arcs make of wrong single epochs."""

import pytest

from fgnav.gnss.difference import double_differences
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.validation import validated
from fgnav.io.flight.folder import load_flight
from tests.integers.wettzell import of_signals, surveyed_cycles, write_flight

# Epochs of 120 that single epochs have wrong, and those used and wrong after validation.
WHOLE = {20: (84, 110, 0), 30: (109, 80, 3), 35: (117, 50, 8)}
CAUSAL = {20: (84, 80, 4), 30: (109, 80, 5), 35: (117, 45, 1)}


@pytest.fixture(scope="module")
def flight(shared, tmp_path_factory):
    return load_flight(write_flight(tmp_path_factory.mktemp("wettzell"), shared))


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("mask_deg", WHOLE)
def test_arcs_are_right_though_most_epochs_are_wrong(flight, mask_deg, causal):
    differences = of_signals(double_differences(flight), {"G1"}, mask_deg)
    resolved = Lambda()(differences, flight)
    true = surveyed_cycles(differences)
    before, used, after = (CAUSAL if causal else WHOLE)[mask_deg]
    assert (resolved.fixed & (resolved.cycles != true)).any(axis=(1, 2)).sum() == before
    found = validated(differences, resolved, ("WTZR", "WTZZ"), 1e-4, causal=causal)
    fixed = found.integers.fixed & ~found.refused[:, None, None]
    assert fixed.any(axis=(1, 2)).sum() >= used
    assert (fixed & (found.integers.cycles != true)).any(axis=(1, 2)).sum() <= after

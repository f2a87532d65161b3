"""Two real antennas whose baseline is surveyed: right as often as published, hardly ever wrong."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.integers.arcs.resolver import constrained_arcs
from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.array.search import search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.validation import validated
from fgnav.io.flight.folder import load_flight
from tests.integers.wettzell import of_signals, right_cycles, surveyed_cycles, write_flight

# Epochs of 120 that single epochs have wrong, and those used and wrong after validation.
WHOLE = {20: (84, 110, 0), 30: (109, 75, 1), 35: (117, 50, 8)}
CAUSAL = {20: (84, 80, 4), 30: (109, 80, 5), 35: (117, 45, 1)}
# Share accepted by degrees of mask; an epoch or two below what was found.
LEAST_AT_1E_3 = {10: 0.99, 15: 0.72, 20: 0.56, 25: 0.38, 30: 0.20, 35: 0.14}
LEAST_AT_1E_2 = {10: 0.99, 15: 0.80, 20: 0.68, 25: 0.55, 30: 0.40, 35: 0.38}


@pytest.fixture(scope="module")
def flight(shared, tmp_path_factory):
    return load_flight(write_flight(tmp_path_factory.mktemp("wettzell"), shared))


@pytest.fixture(scope="module")
def differences(flight):
    return double_differences(flight)


def fixed_right(d, integers):
    """Epochs whose fixed integers are all true, (n,)."""
    fixed_only = replace(d, code_m=np.where(integers.fixed, d.code_m, np.nan))
    return right_cycles(fixed_only, integers.cycles)


def published(shared):
    return json.loads((shared / "integers" / "wtz_single_epoch_success.json").read_text())["rows"]


@pytest.mark.parametrize("mask_deg", [10, 15, 20, 25])
def test_lambda_is_right_as_often_as_rtklib_is(flight, differences, shared, mask_deg):
    rtklib = next(row["LAMBDA_pct"] for row in published(shared) if row["mask_deg"] == mask_deg)
    d = of_signals(differences, {"G1"}, mask_deg)
    found = right_cycles(d, Lambda()(d, flight).cycles)
    assert len(found) == 120
    # one epoch in fifty: the troposphere and a satellite at the mask may be taken differently
    assert 100 * found.mean() == pytest.approx(rtklib, abs=2.0)
    if mask_deg == 10:
        assert found.mean() >= 0.97


def test_three_constellations_are_right_in_every_epoch(flight, differences):
    d = of_signals(differences, {"G1", "E1", "C2"})
    assert right_cycles(d, Lambda()(d, flight).cycles).all()


def test_every_link_of_the_recorded_flight_is_fixed_or_counted(flight, differences):
    integers = Lambda(ratio_min=3.0)(differences, flight)
    links = np.isfinite(differences.phase_m) & ~differences.is_reference[:, None, :]
    assert integers.fixed.sum() + sum(loss.count for loss in integers.unused) == links.sum()


@pytest.mark.parametrize("mask_deg", LEAST_AT_1E_3)
def test_known_length_is_right_as_often_as_published_and_never_accepted_wrong(
    flight, differences, shared, mask_deg
):
    row = next(row for row in published(shared) if row["mask_deg"] == mask_deg)
    d = of_signals(differences, {"G1"}, mask_deg)
    enough = d.resolvable.sum(axis=(1, 2)) >= 4  # five satellites, as the published rows
    assert enough.sum() == row["epochs"]
    found = search_constrained(d, 10**6)
    assert (found.status[enough] == PROVEN).all()
    right = right_cycles(d, found.cycles)
    assert 100 * right[enough].mean() > row["length_constrained_pct"] - 0.1  # its rounding
    noisy = with_estimated_noise(d, 10**6)
    for wrong_max, least in ((1e-3, LEAST_AT_1E_3), (1e-2, LEAST_AT_1E_2)):
        resolved = Constrained(wrong_max=wrong_max, estimate_noise=False)(noisy, flight)
        accepted = resolved.fixed.any(axis=(1, 2))
        assert fixed_right(d, resolved)[accepted].all()
        assert accepted[enough].mean() >= least[mask_deg]


@pytest.mark.parametrize("signals", [{"G1", "G2"}, {"G1", "E1", "C2"}])
@pytest.mark.parametrize("mask_deg", [10, 35])
def test_more_signals_are_nearly_always_accepted_and_always_right(
    flight, differences, signals, mask_deg
):
    d = of_signals(differences, signals, mask_deg)
    resolved = Constrained()(d, flight)
    accepted = resolved.fixed.any(axis=(1, 2))
    assert accepted.mean() >= 0.99
    assert fixed_right(d, resolved)[accepted].all()
    assert resolved.wrong_probability[accepted].mean() <= 1e-3


@pytest.mark.parametrize("mask_deg", [15, 35])
def test_arcs_are_fixed_at_every_epoch_and_rightly(flight, differences, mask_deg):
    d = of_signals(differences, {"G1"}, mask_deg)
    enough = d.resolvable.sum(axis=(1, 2)) >= 4
    found = constrained_arcs()(d, flight)
    assert (found.cycles == surveyed_cycles(d))[found.fixed].all()
    assert found.fixed[d.resolvable & enough[:, None, None]].mean() > 0.98


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("mask_deg", WHOLE)
def test_arcs_are_right_though_most_epochs_are_wrong(flight, differences, mask_deg, causal):
    d = of_signals(differences, {"G1"}, mask_deg)
    resolved, true = Lambda()(d, flight), surveyed_cycles(d)
    before, used, after = (CAUSAL if causal else WHOLE)[mask_deg]
    assert (resolved.fixed & (resolved.cycles != true)).any(axis=(1, 2)).sum() == before
    found = validated(d, resolved, ("WTZR", "WTZZ"), 1e-4, causal=causal)
    fixed = found.integers.fixed & ~found.refused[:, None, None]
    assert fixed.any(axis=(1, 2)).sum() >= used
    assert (fixed & (found.integers.cycles != true)).any(axis=(1, 2)).sum() <= after

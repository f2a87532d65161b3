"""The known length of two real antennas, one epoch at a time, against published success."""

import dataclasses
import json

import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.array.search import PROVEN, search_constrained
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.io.flight.folder import load_flight
from tests.integers.wettzell import of_signals, right_cycles, write_flight

# share accepted by degrees of mask; an epoch or two below what was found
LEAST_AT_1E_3 = {10: 0.99, 15: 0.72, 20: 0.56, 25: 0.38, 30: 0.20, 35: 0.14}
LEAST_AT_1E_2 = {10: 0.99, 15: 0.80, 20: 0.68, 25: 0.55, 30: 0.40, 35: 0.38}


def fixed_right(d, integers):
    """Epochs whose fixed integers are all true, (n,)."""
    fixed_only = dataclasses.replace(d, code_m=np.where(integers.fixed, d.code_m, np.nan))
    return right_cycles(fixed_only, integers.cycles)


@pytest.fixture(scope="module")
def flight(shared, tmp_path_factory):
    return load_flight(write_flight(tmp_path_factory.mktemp("wettzell"), shared))


@pytest.mark.parametrize("mask_deg", [10, 15, 20, 25, 30, 35])
def test_known_length_is_right_as_often_as_published_and_never_accepted_wrong(
    flight, shared, mask_deg
):
    rows = json.loads((shared / "integers" / "wtz_single_epoch_success.json").read_text())["rows"]
    row = next(row for row in rows if row["mask_deg"] == mask_deg)
    d = of_signals(double_differences(flight), {"G1"}, mask_deg)
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
def test_more_signals_are_nearly_always_accepted_and_always_right(flight, signals, mask_deg):
    d = of_signals(double_differences(flight), signals, mask_deg)
    resolved = Constrained()(d, flight)
    accepted = resolved.fixed.any(axis=(1, 2))
    assert accepted.mean() >= 0.99
    assert fixed_right(d, resolved)[accepted].all()
    assert resolved.wrong_probability[accepted].mean() <= 1e-3

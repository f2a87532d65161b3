"""The known length of two real antennas, one epoch at a time, against published success."""

import json

import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.integers.constrained import Constrained
from fgnav.integers.constrained_search import PROVEN, search_constrained
from fgnav.io.flight_folder import load_flight

from .wettzell import of_signals, right_cycles, write_flight


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
    resolved = Constrained()(d, flight)
    accepted = resolved.fixed.any(axis=(1, 2))
    assert right_cycles(d, resolved.cycles)[accepted].all()
    least = {10: 0.95, 15: 0.55, 20: 0.40, 25: 0.25}.get(mask_deg, 0.0)
    assert accepted[enough].mean() >= least


@pytest.mark.parametrize("signals", [{"G1", "G2"}, {"G1", "E1", "C2"}])
@pytest.mark.parametrize("mask_deg", [10, 35])
def test_more_signals_are_nearly_always_accepted_and_always_right(flight, signals, mask_deg):
    d = of_signals(double_differences(flight), signals, mask_deg)
    resolved = Constrained()(d, flight)
    accepted = resolved.fixed.any(axis=(1, 2))
    assert accepted.mean() >= 0.99
    assert right_cycles(d, resolved.cycles)[accepted].all()
    assert np.all(resolved.wrong_probability[accepted] <= 1e-3)

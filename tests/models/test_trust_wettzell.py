"""Two real antennas are outside the trust network's domain: what it says of them is never wrong."""

import dataclasses

import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.io.flight.folder import load_flight
from fgnav_models.runtime.resolver import Network
from tests.integers.wettzell import of_signals, right_cycles, write_flight


@pytest.fixture(scope="module")
def flight(shared, tmp_path_factory):
    return load_flight(write_flight(tmp_path_factory.mktemp("wettzell"), shared))


@pytest.mark.parametrize("mask_deg", [10, 15, 20, 25, 30, 35])
def test_no_epoch_trusted_beyond_one_in_a_thousand_is_wrong(flight, mask_deg):
    d = of_signals(double_differences(flight), {"G1"}, mask_deg)
    integers = Network()(d, flight)
    assert (
        "antennas outside 3 to 8, the network's training domain: left to constrained"
        in integers.losses[0].reason
    )
    assert integers.losses[0].count == d.resolvable.any(axis=(1, 2)).sum()
    sure = integers.fixed.any(axis=(1, 2)) & (integers.wrong_probability < 1e-3)
    assert sure.any()
    fixed = dataclasses.replace(d, code_m=np.where(integers.fixed, d.code_m, np.nan))
    assert right_cycles(fixed, integers.cycles)[sure].all()

"""Two real antennas: what the trust network accepts of them is never wrong."""

import dataclasses

import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.io.flight.folder import load_flight
from fgnav_models.runtime.resolver import Network, handed_over
from tests.integers.wettzell import of_signals, right_cycles, write_flight


@pytest.fixture(scope="module")
def flight(shared, tmp_path_factory):
    return load_flight(write_flight(tmp_path_factory.mktemp("wettzell"), shared))


@pytest.mark.parametrize("signals", [("G1",), ("G1", "E1"), ("G1", "E1", "C2")])
@pytest.mark.parametrize("mask_deg", [10, 15, 20, 25, 30, 35])
def test_no_epoch_that_is_accepted_is_wrong(flight, mask_deg, signals):
    d = of_signals(double_differences(flight), set(signals), mask_deg)
    integers = Network()(d, flight)
    answered = d.resolvable.any(axis=(1, 2)).sum() - sum(handed_over(integers).values())
    assert answered > 0.8 * len(d.t_s)
    fixed = integers.fixed.any(axis=(1, 2))
    kept = dataclasses.replace(d, code_m=np.where(integers.fixed, d.code_m, np.nan))
    assert right_cycles(kept, integers.cycles)[fixed].all()
    if len(signals) == 3 and mask_deg <= 20:
        assert fixed.mean() > 0.9

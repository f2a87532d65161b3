"""Campaigns that come along: they can be flown as they stand, and are as large as they say."""

import msgspec
import numpy as np
import pytest

from fgnav.campaign.fly import check_order, flight_source, fly
from fgnav.campaign.order import Run, load_order, runs_of
from fgnav.geometry.rotations import to_euler
from fgnav.photodetector import line_of_sight
from fgnav.shipped import shipped

CAMPAIGNS = shipped("fgnav_sim", "campaigns")
RUNS = {
    "flown": 4 * 10,
    "restitution": 4 * 2 * 9 * 3,  # conditions, motions, amplitudes, flights
    "degraded": (4 + 4 + 3 + 3 + 3 + 4 + 3 + 3 + 4 + 4) * 10,
}


def test_each_is_judged_here():
    assert set(CAMPAIGNS) == set(RUNS)


@pytest.mark.parametrize("name", RUNS)
def test_every_method_and_column_can_be_had(name):
    order = load_order(CAMPAIGNS[name])
    check_order(order)
    assert len(list(runs_of(order))) == RUNS[name]


@pytest.fixture(scope="module")
def restitution():
    return load_order(CAMPAIGNS["restitution"])


@pytest.mark.parametrize("case", [0, 1])
def test_restitution_reaches_the_paper_s_amplitudes_and_sees_its_landmark(restitution, case):
    table = restitution.case[case]
    for column, amplitude_deg in enumerate(table.sweep.values):
        changes = table.changed(column)
        if column % 4:
            continue
        flight = flight_source().fly(table.scenario, changes, 0, np.random.default_rng(1))
        angles_deg = np.degrees(to_euler(flight.truth.R_nb))
        assert flight.truth.t_s[-1] == pytest.approx(9.9)
        # The last sample is at 9.9 of 10 s; a sine of 1 rad/s has had its peak at 1.6 s.
        reach = np.abs(angles_deg).max(axis=0)
        np.testing.assert_allclose(reach, amplitude_deg * (0.99, 1.0)[case], rtol=1e-3)
        assert len(set(flight.observations.satellites)) == 6
        e_b = line_of_sight(flight.photodetector)
        assert e_b.t_s[0] >= 7.0
        at = np.argmin(np.abs(e_b.t_s - 8.5))
        np.testing.assert_allclose(e_b.e_b[at], [1.0, 0.0, 0.0], atol=5e-3)


def test_a_degraded_flight_of_each_kind_is_flown():
    order = load_order(CAMPAIGNS["degraded"])
    ml = tuple(m for m in order.method if m.method == "maximum-likelihood")
    for number, case in enumerate(order.case):
        short = {**case.changes, "duration_s": 2.0}
        if case.scenario == "approach" or case.name == "outage":
            continue  # they begin later than these two seconds
        cases = [*order.case]
        cases[number] = msgspec.structs.replace(case, changes=short)
        own = msgspec.structs.replace(order, method=ml, baseline=None, case=tuple(cases))
        record = fly(own, Run(case=number, column=case.columns - 1, flight=0))
        assert record["failure"] is None, case.name
        figures = record["methods"]["maximum likelihood"]["figures"]
        assert figures["available"] > 0, case.name

"""An instrument that is wrong for seconds: left out, in place of a noise that explains it."""

from dataclasses import replace

import numpy as np

from fgnav.frontend.problem import build_problem
from fgnav.identification.apply import with_findings
from tests.identification.identified import SETTINGS, found_in
from tests.robustness.drawn.flights import right_flight

FROM_S, UNTIL_S = 4.0, 8.0


def in_another_order(flight, order):
    seeker = flight.seeker
    inside = (seeker.t_s > FROM_S) & (seeker.t_s <= UNTIL_S)
    currents = np.where(inside[:, None], seeker.currents[:, order], seeker.currents)
    return replace(flight, seeker=replace(seeker, currents=currents))


def test_exchanged_quadrants_are_left_out_while_they_last():
    """No gains of theirs explain them."""
    flight = in_another_order(right_flight("seeker", 801), (0, 2, 1, 3))
    found = found_in(flight)
    (one,) = found.rejected
    assert one.what == "line of sight"
    assert abs(one.from_s - FROM_S) < 1.0
    assert abs(one.until_s - UNTIL_S) < 1.0
    assert found.factors.keys() <= {"velocity"}  # which is not stated
    assert found.turn is None
    prepared = with_findings(flight, SETTINGS, found, build_problem)
    assert one in prepared.rejections
    sights = next(m for m in prepared.problem.measurements if m.name == "line of sight")
    t_s = prepared.problem.t_s[sights.row]
    assert not np.any((t_s > FROM_S) & (t_s <= UNTIL_S))


def test_an_accelerometer_that_is_loud_is_not_the_detector():
    right = right_flight("seeker", 801)
    rng = np.random.default_rng(3)
    imu = right.imu
    loud = replace(imu, f_b_mps2=imu.f_b_mps2 + rng.normal(scale=0.3, size=imu.f_b_mps2.shape))
    found = found_in(replace(right, imu=loud))
    assert found.rejected == ()
    assert "accelerometer" in found.factors

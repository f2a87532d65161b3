"""Causal methods whose measurements contradict each other: from when on what is left out."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.frontend.causal.truncation import truncated
from fgnav.methods.smoother import Forward
from fgnav.methods.smoothing.so_far import CausalMethod, consistent_so_far
from fgnav.types.estimate import Consistency, Contradiction, Estimate
from tests.robustness.faults import FAULTS, right_flights

WRONG = next(fault for fault in FAULTS if fault.name == "currents exchanged")
SPAN_S, CUTS_S = 6.0, (2.35, 4.65)
ENDS_S = tuple(k + 1.0 for k in range(20))  # of seconds
T_S = np.arange(200) / 10


@cache
def damaged():
    return truncated(WRONG.damaged(right_flights(20.0)[WRONG.flight]), SPAN_S)


@cache
def estimated():
    return Forward()(damaged())


def left_out(estimate):
    return [one for one in estimate.rejections if "what noise explains" in one.reason]


def test_an_instrument_is_left_out_from_when_it_is_known_to_contradict():
    found = estimated()
    (rejected,) = left_out(found)
    assert rejected.what == "line of sight"
    assert CUTS_S[0] > rejected.from_s > 0.5
    assert rejected.until_s == found.t_s[-1]
    assert found.notes[0].startswith(f"Line of sight from {rejected.from_s:.1f} to ")
    assert not any(one.contradictions for one in found.consistency)


@pytest.mark.parametrize("cut_s", CUTS_S)
def test_what_was_said_before_a_cut_stays_the_same(cut_s):
    part = Forward()(truncated(damaged(), cut_s))
    n = len(part.t_s)
    assert part.t_s[-1] > cut_s - 0.2
    for field in ("t_s", "R_nb", "p_n_m", "v_n_mps", "attitude_covariance_rad2"):
        expected = getattr(estimated(), field)[:n]
        np.testing.assert_allclose(getattr(part, field), expected, rtol=0, atol=1e-9)


def of_field(flight, *, since_s=5.0, throughout=False):
    """Return an estimate that the magnetic field contradicts as long as the flight has one."""
    until_s = 0.0 if flight.barometer is None else flight.barometer.t_s[-1]
    wrong = flight.magnetometer is not None and until_s > since_s
    span = Contradiction(
        from_s=since_s, until_s=until_s, freedom=100, nis=50.0, throughout=throughout
    )
    test = Consistency(
        what="magnetic field",
        count=100,
        freedom=300,
        nis=50.0 if wrong else 1.0,
        beyond_99=0.01,
        contradictions=(span,) if wrong else (),
        beyond_s=tuple(s for s in ENDS_S if s > since_s) if wrong else (),
    )
    n = int((until_s + 0.05 >= T_S).sum())
    return Estimate(
        method="any",
        t_s=T_S[:n],
        epochs=n,
        R_nb=np.tile(np.eye(3), (n, 1, 1)),
        consistency=(test,),
    )


def so_far(flight, whole, estimated=of_field):
    prepared = SimpleNamespace(stretches=(), problem=SimpleNamespace(t_s=T_S))
    method = CausalMethod(
        prepare=lambda _, __: prepared,
        estimated=lambda one, _: estimated(one),
        whole=whole,
        waits_s=0.0,
    )
    return consistent_so_far(flight, prepared, method)


def test_what_is_left_out_is_decided_by_the_record_up_to_then():
    asked = []

    def whole(flight):
        asked.append(flight.barometer.t_s[-1])
        return of_field(flight, throughout=True)

    found = so_far(right_flights(20.0)["single"], whole)
    assert max(asked) <= 6.0
    (rejected,) = found.rejections
    assert (rejected.from_s, rejected.until_s) == (6.0, T_S[-1])
    np.testing.assert_array_equal(found.t_s, T_S)


def test_where_nothing_consistent_is_left_there_are_no_estimates():
    def whole(flight):
        return of_field(
            replace(flight, magnetometer=right_flights(20.0)["single"].magnetometer),
            throughout=True,
        )

    found = so_far(right_flights(20.0)["single"], whole)
    np.testing.assert_array_equal(found.t_s, T_S[T_S < 6.0])
    (loss,) = found.losses
    assert (loss.count, loss.what) == (200 - len(found.t_s), "keyframe")
    assert found.notes[0] == (
        "No estimate from 6.0 to 19.9 s: measurements so far contradict each other."
    )


def test_a_record_without_any_estimate_is_refused():
    def wrong(flight):
        flight = replace(flight, magnetometer=right_flights(20.0)["single"].magnetometer)
        found = of_field(flight, since_s=-1.0, throughout=True)
        test = replace(found.consistency[0], beyond_s=(-0.5, *ENDS_S))
        return replace(found, consistency=(test,))

    with pytest.raises(NoSolutionError, match="contradict each other: magnetic field"):
        so_far(right_flights(20.0)["single"], wrong, wrong)


def test_noise_that_is_believed_is_never_a_reason_to_leave_out():
    found = so_far(right_flights(20.0)["single"], None)
    np.testing.assert_array_equal(found.t_s, T_S)
    assert found.rejections == ()
    assert "contradict each other" in found.notes[0]

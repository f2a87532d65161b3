"""Three hundred damaged flights; five thousand are ``make bench ONLY=damage``."""

import pytest

from tests.robustness.outcomes import BAD, GOOD, case

CASES, PER_TEST = 300, 25
# What an estimator makes of series that are well-formed and wrong is counted by the benchmark.
NEVER = tuple(kind for kind in BAD if kind != "silent and wrong")


@pytest.mark.parametrize("first", range(0, CASES, PER_TEST))
def test_a_damaged_flight_is_refused_said_or_harmless(first, whole_flights, tmp_path):
    seeds = range(1_000_000 + first, 1_000_000 + first + PER_TEST)
    outcomes = [case(whole_flights[seed % 2], seed, tmp_path) for seed in seeds]
    assert [one for one in outcomes if one.kind in NEVER] == []


@pytest.mark.parametrize("seed", [2002640, 2002951])
def test_a_system_that_is_open_and_a_track_without_epochs_are_answered(
    seed, whole_flights, tmp_path
):
    """An ambiguity of an arc beside walks of 1e9 m, and a record of few rows, were tracebacks."""
    assert case(whole_flights[seed % 2], seed, tmp_path).kind in GOOD

"""Equations for the antenna's position: what is left of phase is way, integers and noise."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.gnss.difference import differenced
from fgnav.gnss.position_phase import position_phase
from tests.gnss.based import antenna_n_m, flown

QUIET = {"phase_noise_m": 1e-6, "code_noise_m": 1e-3, "doppler_noise_mps": 1e-4}


@pytest.mark.parametrize("atmosphere", [True, False])
def test_double_differences_against_the_base_less_the_way_are_integers(atmosphere):
    flight = flown(span_s=3.0, atmosphere=atmosphere, **QUIET)
    equations = position_phase(flight, base=True)
    d = differenced(equations.single, ("base", "a1"))
    apart_n_m = antenna_n_m(flight, d.t_s) + equations.late_n_m - equations.start_n_m
    way_m = -np.einsum("nmi,ni->nm", d.e_n, apart_n_m)
    of_reference = d.reference[:, d.group].clip(0)
    way_m -= np.take_along_axis(way_m, of_reference, axis=1)
    cycles = (d.phase_m[:, 0] - way_m) / d.wavelength_m
    known = np.isfinite(cycles)
    assert np.abs(cycles - np.rint(cycles))[known].max() < 0.01
    assert known.sum() > 7 * len(d.t_s)


def test_epochs_that_the_base_lacks_have_no_equations():
    flight = flown(span_s=3.0)
    one = np.arange(0, len(flight.base.observations.t_s), 10)
    seldom = replace(flight, base=replace(flight.base, observations=rows(flight.base, one)))
    equations = position_phase(seldom, base=True)
    np.testing.assert_allclose(equations.single.t_s, [0.0, 1.0, 2.0], rtol=0, atol=1e-9)


def rows(base, at):
    seen = base.observations
    names = ("t_s", "tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    return replace(seen, **{name: getattr(seen, name)[at] for name in names})


def test_what_stays_with_a_satellite_is_not_in_its_code():
    """Neither an error of its message, nor the clock that all of a group share."""
    flight = flown(span_s=3.0, base=None, **QUIET)
    off_m = np.random.default_rng(0).normal(0.0, 2.0, flight.observations.code_m.shape[-1])
    seen = replace(flight.observations, code_m=flight.observations.code_m + off_m)
    code_m = position_phase(replace(flight, observations=seen), base=False).single.code_m[:, 0]
    code_m = code_m[:, np.isfinite(code_m).all(axis=0)]
    assert code_m.shape[1] >= 6
    clock_m = np.median(code_m, axis=1, keepdims=True)
    np.testing.assert_allclose(code_m - clock_m, 0.0, atol=0.1)


def test_a_flight_without_a_base_or_observations_says_so():
    with pytest.raises(NoSolutionError, match="a position by phase needs a base station"):
        position_phase(flown(span_s=3.0, base=None), base=True)
    bare = replace(flown(span_s=3.0), observations=None, base=None)
    with pytest.raises(NoSolutionError, match="a position by phase needs observations"):
        position_phase(bare, base=False)

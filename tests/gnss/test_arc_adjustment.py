"""Positions by phase without integers: millimetres from epoch to epoch, code for where that is."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.gnss.arc_adjustment import adjust_arcs, adjust_best
from fgnav.gnss.position_phase import position_phase
from fgnav_sim.receiver_tables import MultipathTable, OutageTable, SlipsTable
from tests.gnss.based import antenna_n_m, flown

NAMES = ("models", "a1")


def adjusted(flight, *, base=False):
    return adjust_arcs(position_phase(flight, base=base), NAMES)


def errors(flight, positions):
    return positions.p_n_m - antenna_n_m(flight, positions.t_s)


def nees(error, covariance):
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)


def test_the_way_is_known_to_millimetres_and_as_well_as_stated():
    found = adjusted(flown(base=None)).positions()
    error = errors(flown(base=None), found)
    own = error - error.mean(axis=0)
    assert (np.sqrt((own**2).mean(axis=0)) < [0.003, 0.003, 0.007]).all()
    assert 2.4 < nees(own, found.noise_m2).mean() < 3.4


def test_the_place_is_known_as_well_as_stated():
    flights = [flown(base=None, span_s=5.0, seed=seed) for seed in range(16)]
    squares = []
    for flight in flights:
        found = adjusted(flight).positions()
        mean = errors(flight, found).mean(axis=0)
        squares.append(float(nees(mean[None], found.common_m2.mean(axis=0)[None])[0]))
    assert 1.5 < np.mean(squares) < 4.8  # 16 of three degrees of freedom: 3 +- 0.6


def test_echoes_of_the_code_that_last_are_not_averaged_away():
    echoes = MultipathTable(code_m=0.5, phase_m=0.0, time_constant_s=5.0)
    squares, sigma_m = [], []
    for seed in range(4):
        flight = flown(base=None, seed=seed, rate_hz=2.0, span_s=60.0, multipath=echoes)
        found = adjusted(flight).positions()
        mean = errors(flight, found).mean(axis=0)
        squares.append(float(nees(mean[None], found.common_m2.mean(axis=0)[None])[0]))
        sigma_m.append(np.sqrt(np.diagonal(found.common_m2[0])).max())
    assert np.mean(squares) < 6.0
    assert min(sigma_m) > 0.1  # white noise of as much would be known to 5 cm


def test_slips_nobody_announced_do_not_move_positions():
    flight = flown(base=None, slips=SlipsTable(rate_per_hour=120, flagged_share=0.0))
    error = errors(flight, adjusted(flight).positions())
    assert np.abs(error - error.mean(axis=0)).max() < 0.03


def test_an_outage_of_all_satellites_parts_the_flight():
    flight = flown(base=None, outages=(OutageTable(from_s=8.0, until_s=12.0),))
    found = adjusted(flight).positions()
    assert len(np.unique(found.piece)) == 2
    for piece in np.unique(found.piece):
        error = errors(flight, found)[found.piece == piece]
        assert np.abs(error - error.mean(axis=0)).max() < 0.03


def test_long_arcs_are_cut_one_after_the_other_so_positions_stay_connected():
    flight = flown(base=None, span_s=700.0, rate_hz=0.5)
    found = adjusted(flight)
    assert len(found.epochs.channel) > 2 * len(flight.observations.satellites)
    positions = found.positions()
    assert len(np.unique(positions.piece)) == 1
    error = errors(flight, positions)
    assert np.sqrt(((error - error.mean(axis=0)) ** 2).mean(axis=0)).max() < 0.02


def test_known_constants_leave_no_doubt_of_them():
    found = adjusted(flown(base=None))
    a = len(found.epochs.channel)
    value_m = found.constant_m[:-1] + 0.05
    known = found.given(np.eye(a), value_m)
    np.testing.assert_allclose(known.constant_m[:-1], value_m, rtol=0, atol=1e-9)
    assert np.abs(known.positions().common_m2).max() < 1e-9
    # A shift of all phases is their clock's.
    np.testing.assert_allclose(known.positions().p_n_m, found.positions().p_n_m, rtol=0, atol=1e-6)


def test_a_spin_that_winds_up_the_phase_is_refused_and_unwound_it_is_not():
    flight = flown(name="spin", base=None, wind_up=True)
    with pytest.raises(NoSolutionError, match="a body that spins winds up each satellite's phase"):
        adjusted(flight)
    equations = position_phase(flight, base=False)
    unwound = equations.unwound(flight.truth.R_nb, flight.origin.R_ne[:, 2])
    found = adjust_arcs(unwound, NAMES).positions()
    error = errors(flight, found)
    assert np.abs(error - error.mean(axis=0)).max() < 0.03


def test_phase_that_drifts_off_the_code_is_refused():
    """A drift along the vehicle's way looks like motion to phase; only code knows better."""
    flight = flown(base=None)
    equations = position_phase(flight, base=False)
    single = equations.single
    drift_m = 0.2 * single.t_s[:, None] * single.e_n[:, :, 0]
    moved = replace(single, phase_m=single.phase_m + drift_m[:, None])
    with pytest.raises(NoSolutionError, match=r"code is .* times as far from it, squared"):
        adjust_arcs(replace(equations, single=moved), NAMES)


def with_phases(equations, more_m):
    """Return equations with something added to their phases."""
    single = equations.single
    return replace(equations, single=replace(single, phase_m=single.phase_m + more_m))


def test_between_readings_of_phases_that_fit_alike_positions_are_half_way_and_unsure():
    """The other reading only moves: nothing in its phases contradicts that."""
    equations, drift_n_mps = (
        position_phase(flown(base=None), base=False),
        np.array([2e-3, 0, -1e-3]),
    )
    t_s = equations.single.t_s - equations.single.t_s.mean()
    moving = with_phases(equations, -(equations.single.e_n @ drift_n_mps * t_s[:, None])[:, None])
    found = adjust_best((equations, moving), NAMES, np.eye(3))
    slope = np.polyfit(t_s, found.unsure_n_m, 1)[0]
    np.testing.assert_allclose(np.abs(slope), np.abs(drift_n_mps) / 2, rtol=0, atol=1e-4)
    alone = adjust_best((equations,), NAMES, np.eye(3)).positions().p_n_m
    moved = np.polyfit(t_s, found.positions().p_n_m - alone, 1)[0]
    np.testing.assert_allclose(moved, drift_n_mps / 2, rtol=0, atol=3e-4)


def test_a_reading_that_clearly_fits_worse_makes_nothing_unsure():
    equations = position_phase(flown(base=None), base=False)
    noise_m = 0.01 * np.random.default_rng(0).standard_normal(equations.single.phase_m.shape)
    for pair in (
        (equations, with_phases(equations, noise_m)),
        (with_phases(equations, noise_m), equations),
    ):
        found = adjust_best(pair, NAMES, np.eye(3))
        assert not found.unsure_n_m.any()
        assert found.equations is equations


def test_against_a_base_phases_are_never_between_readings():
    """Their integers are those of one."""
    equations = position_phase(flown(base=None), base=False)
    found = adjust_best((equations, with_phases(equations, 0.0)), NAMES)
    assert not found.unsure_n_m.any()

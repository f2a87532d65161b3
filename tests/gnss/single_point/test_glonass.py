"""GLONASS codes in positions: of a real receiver, with precise orbits."""

from dataclasses import replace

import numpy as np

from fgnav.gnss.single_point.model import code_channels, code_ranges
from fgnav.gnss.single_point.solution import code_solution
from tests.gnss.recordings import precise, wettzell


def of_constellations(shared, letters, mask_deg):
    flight = wettzell(shared)
    observations = flight.observations
    columns = np.flatnonzero([name[0] in letters for name in observations.satellites])
    by_channel = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    observations = replace(
        observations,
        satellites=tuple(observations.satellites[j] for j in columns),
        signals=tuple(observations.signals[j] for j in columns),
        **{name: getattr(observations, name)[:, :, columns] for name in by_channel},
    )
    return replace(
        flight,
        observations=observations,
        precise=precise(shared),
        elevation_mask_rad=np.radians(mask_deg),
    )


def test_glonass_codes_make_positions_that_gps_alone_has_not(shared):
    gps = code_solution(of_constellations(shared, "G", 40.0))
    both = code_solution(of_constellations(shared, "GR", 40.0))
    assert len(gps.t_s) == 112
    assert len(both.t_s) == 120
    down_m = [np.sqrt((one.p_n_m[:, 2] ** 2).mean()) for one in (gps, both)]
    assert down_m[1] < 0.65 * down_m[0] < 0.65 * 4.3  # 2.5 of 4.1 m


def test_glonass_doppler_and_phase_stay_out(shared):
    flight = of_constellations(shared, "GR", 10.0)
    channels = code_channels(flight.observations, 0)
    ranges = code_ranges(flight, flight.observations, channels, 0, np.arange(3))
    glonass = np.array([name[0] == "R" for name in channels.satellites])
    assert np.isfinite(ranges.range_m[:, glonass]).any()
    assert not np.isfinite(ranges.rate_mps[:, glonass]).any()
    assert np.isfinite(ranges.rate_mps[:, ~glonass]).any()


def test_without_precise_orbits_glonass_makes_no_position(shared):
    flight = replace(of_constellations(shared, "GR", 10.0), precise=None)
    without = replace(of_constellations(shared, "G", 10.0), precise=None)
    both, gps = code_solution(flight), code_solution(without)
    np.testing.assert_allclose(both.p_n_m, gps.p_n_m, rtol=0, atol=1e-3)

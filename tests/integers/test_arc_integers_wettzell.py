"""Two real receivers as vehicle and base: where they are known to millimetres from each other."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.flight import Base
from fgnav.gnss.arc_adjustment import adjust_arcs
from fgnav.gnss.position_phase import position_phase
from fgnav.integers.arc_integers import resolve_arcs
from fgnav.io.flight_folder import load_flight
from tests.integers.wettzell import BASELINE_ENU_M, write_flight


@pytest.fixture(scope="module")
def flight(shared, tmp_path_factory):
    """WTZR as the vehicle, whose base is WTZZ."""
    both = load_flight(write_flight(tmp_path_factory.mktemp("wettzell"), shared))
    marker_e_m = np.array([4075579.1913, 931853.3696, 4801569.1897])
    up_e = marker_e_m / np.linalg.norm(marker_e_m)
    base = Base(position_e_m=marker_e_m + 0.284 * up_e, observations=only(both.observations, 1))
    return replace(
        both, antennas=both.antennas[:1], observations=only(both.observations, 0), base=base
    )


def only(seen, antenna):
    names = ("tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    return replace(seen, **{name: getattr(seen, name)[:, [antenna]] for name in names})


def test_a_real_base_tells_where_a_real_antenna_is_to_millimetres(flight):
    found = resolve_arcs(
        adjust_arcs(position_phase(flight, base=True), ("WTZZ", "WTZR")), wrong_max=1e-3
    )
    assert found.fixed.mean() > 0.9
    positions = found.adjustment.positions()
    place_n_m = flight.origin.to_n(flight.base.position_e_m[None])[0]
    place_n_m -= BASELINE_ENU_M[[1, 0, 2]] * [1, 1, -1]
    error = positions.p_n_m - place_n_m
    assert len(error) == 120
    assert (np.abs(error.mean(axis=0)) < [0.003, 0.003, 0.005]).all()
    assert np.abs(error).max() < 0.01

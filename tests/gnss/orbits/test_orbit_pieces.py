import numpy as np
import pytest

from fgnav.gnss.orbits.broadcast import choose, kepler_orbit
from fgnav.gnss.orbits.satellites import satellite_states
from fgnav.types.orbits import BroadcastOrbits
from tests.gnss import recordings

EVERY = 50  # of 700 times


def messages(shared):
    records = recordings.broadcast(shared).records.copy()
    records["health"] = 0  # the most eccentric orbits are those of satellites out of order
    satellites = tuple(dict.fromkeys(map(str, records["satellite"])))
    return BroadcastOrbits(records=records, klobuchar=np.zeros(8)), satellites


@pytest.mark.parametrize("span_s", [20.0, 2000.0])
def test_polynomials_are_as_exact_as_the_messages(shared, span_s):
    orbits, satellites = messages(shared)
    t_s = np.median(orbits.records["toe_s"]) + np.linspace(0.0, span_s, 100)
    step_s = 0.05
    seen = set()
    for satellite in satellites:
        chosen = choose(orbits, satellite, t_s)
        found = satellite_states(orbits, (satellite,), t_s[:, None])
        for row in np.unique(chosen.row[chosen.usable]):
            at = chosen.usable & (chosen.row == row)
            message = chosen.records[row : row + 1]
            p_e_m, clock_s = kepler_orbit(satellite, message, t_s[at])
            after, _ = kepler_orbit(satellite, message, t_s[at] + step_s)
            before, _ = kepler_orbit(satellite, message, t_s[at] - step_s)
            np.testing.assert_allclose(found.p_e_m[at, 0], p_e_m, rtol=0, atol=1e-6)
            np.testing.assert_allclose(found.clock_s[at, 0], clock_s, rtol=0, atol=1e-15)
            v_e_mps = (after - before) / (2 * step_s)  # good to 2e-6 m/s
            np.testing.assert_allclose(found.v_e_mps[at, 0], v_e_mps, rtol=0, atol=2e-6)
            seen.add(satellite[0])
    assert {"G", "E", "C"} <= seen


def test_what_is_said_of_a_time_depends_on_no_other(shared):
    orbits, satellites = messages(shared)
    t_s = np.median(orbits.records["toe_s"]) + np.linspace(0.0, 2000.0, 700)
    at_s = np.repeat(t_s[:, None], len(satellites), axis=1)
    many = satellite_states(orbits, satellites, at_s, by_clock=True)
    for rows in (slice(0, 1), slice(300, 340), slice(None, None, EVERY)):
        few = satellite_states(orbits, satellites, at_s[rows], by_clock=True)
        for name in ("p_e_m", "v_e_mps", "clock_s", "clock_drift_sps"):
            np.testing.assert_array_equal(getattr(few, name), getattr(many, name)[rows])

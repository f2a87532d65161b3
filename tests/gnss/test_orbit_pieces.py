import numpy as np
import pytest

from fgnav.gnss.satellites import satellite_states
from fgnav.orbits import BroadcastOrbits
from tests.gnss import recordings

EVERY = 50  # of 700 times that are looked at one by one: so few that nothing is interpolated


@pytest.mark.parametrize("span_s", [20.0, 2000.0])
def test_polynomials_say_what_every_single_time_does(shared, span_s):
    records = recordings.broadcast(shared).records.copy()
    records["health"] = 0  # the most eccentric orbits are those of satellites out of order
    orbits = BroadcastOrbits(records=records, klobuchar=np.zeros(8))
    satellites = tuple(dict.fromkeys(map(str, records["satellite"])))
    t_s = np.median(records["toe_s"]) + np.linspace(0.0, span_s, 700)
    at_s = np.repeat(t_s[:, None], len(satellites), axis=1)
    many = satellite_states(orbits, satellites, at_s)
    few = satellite_states(orbits, satellites, at_s[::EVERY])
    known = np.isfinite(few.p_e_m).all(axis=(0, 2))
    assert {"G", "E", "C"} <= {name[0] for name, k in zip(satellites, known, strict=True) if k}
    for name, atol in (
        ("p_e_m", 1e-6),
        ("v_e_mps", 2e-6),  # as good as central differences are
        ("clock_s", 1e-15),
        ("clock_drift_sps", 1e-14),
    ):
        found, expected = getattr(many, name)[::EVERY], getattr(few, name)
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol)

import numpy as np
import pytest

from fgnav.types.observations import Observations


@pytest.fixture
def observations():
    shape = (5, 2, 3)
    values = np.arange(30.0).reshape(shape)
    return Observations(
        t_s=np.arange(5.0),
        tag_s=np.arange(10.0).reshape(5, 2),
        satellites=("G01", "G02", "E03"),
        signals=("1C", "1C", "1C"),
        code_m=values,
        phase_cycles=values + 100,
        doppler_hz=values + 200,
        cn0_dbhz=values + 300,
        lock_flags=np.arange(30).reshape(shape),
    )


@pytest.mark.parametrize(
    "epochs", [slice(1, 4, 2), np.array([1, 3]), np.array([False, True, False, True, False])]
)
def test_some_epochs_keep_all_antennas_and_channels(observations, epochs):
    some = observations[epochs]
    assert some.t_s.tolist() == [1.0, 3.0]
    assert some.tag_s.tolist() == [[2.0, 3.0], [6.0, 7.0]]
    for field, first in {
        "code_m": 6,
        "phase_cycles": 106,
        "doppler_hz": 206,
        "cn0_dbhz": 306,
    }.items():
        assert getattr(some, field)[0].ravel().tolist() == list(range(first, first + 6))
    assert some.lock_flags[1].ravel().tolist() == list(range(18, 24))
    assert (some.satellites, some.signals) == (observations.satellites, observations.signals)

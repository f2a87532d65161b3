"""Several receivers on one set of epochs and channels."""

import numpy as np
import pytest

from fgnav.checks import BadInputError, Unused
from fgnav.io.antennas import merge, nominal_epochs
from fgnav.types.observations import Observations

START_GPS_S = 1_277_078_400.5


def one(t_s, channels, offset_s=0.0, base=0.0) -> Observations:
    """Return one antenna whose code tells epoch and channel: ``base + 10 * epoch + channel``."""
    t_s = np.asarray(t_s, float)
    value = base + 10.0 * np.arange(len(t_s))[:, None, None] + np.arange(len(channels))
    return Observations(
        t_s=t_s,
        tag_s=t_s[:, None] + offset_s,
        satellites=tuple(c[:3] for c in channels),
        signals=tuple(c[4:] for c in channels),
        code_m=value,
        phase_cycles=value + 0.5,
        doppler_hz=-value,
        cn0_dbhz=value + 1,
        lock_flags=np.ones(value.shape, np.uint8),
    )


def test_channels_are_united_and_missing_ones_are_gaps():
    got = merge(
        [one([0, 1], ["G05 1C", "G07 1C"]), one([0, 1], ["G07 1C", "E01 1C"], base=100)], "ab"
    )
    assert list(zip(got.satellites, got.signals, strict=True)) == [
        ("E01", "1C"),
        ("G05", "1C"),
        ("G07", "1C"),
    ]
    np.testing.assert_array_equal(got.code_m[1], [[np.nan, 10, 11], [111, np.nan, 110]])
    np.testing.assert_array_equal(got.lock_flags[1], [[0, 1, 1], [1, 0, 1]])


def test_epochs_are_those_of_the_reference_and_others_are_counted():
    got = merge([one([0, 2, 3], ["G05 1C"]), one([0, 1, 3, 4], ["G05 1C"], 1e-4)], ["ref", "other"])
    assert got.t_s.tolist() == [0, 2, 3]
    np.testing.assert_array_equal(got.code_m[:, 1, 0], [0, np.nan, 20])
    np.testing.assert_allclose(got.tag_s[:, 1], [1e-4, 2, 3 + 1e-4], rtol=0, atol=1e-12)
    assert got.unused == (
        Unused(what="other epoch", reason="the reference antenna ref has no such epoch", count=2),
    )


def test_epochs_match_within_the_tolerance_only():
    reference = one(0.1 * np.arange(5), ["G05 1C"])
    for shift_s, found in ((0.019, 5), (0.021, 0)):
        late = one(0.1 * np.arange(5) + shift_s, ["G05 1C"])
        if found:
            assert np.isfinite(merge([reference, late], "ab").code_m[:, 1]).sum() == found
        else:
            with pytest.raises(BadInputError, match="antenna b: shares no epoch with antenna a"):
                merge([reference, late], "ab")


def test_two_epochs_near_one_of_the_reference_count_once():
    late = one([0.0, 0.004, 0.1], ["G05 1C"])
    got = merge([one([0, 0.1, 0.2], ["G05 1C"]), late], "ab")
    np.testing.assert_array_equal(got.code_m[:, 1, 0], [0, 20, np.nan])
    assert got.unused[0].count == 1


def test_nominal_epochs_take_the_clock_error_away():
    rng = np.random.default_rng(2)
    for step_s in (0.01, 0.05, 0.1, 1.0, 30.0):
        nominal_s = step_s * np.arange(50) + 0.5
        tag_s = nominal_s + rng.uniform(-1e-3, 1e-3, 50)
        np.testing.assert_allclose(nominal_epochs(tag_s, START_GPS_S), nominal_s, rtol=0, atol=1e-9)

    tag_s = np.cumsum(np.random.default_rng(2).uniform(0.5, 1.5, 20))
    np.testing.assert_array_equal(nominal_epochs(tag_s, START_GPS_S), tag_s)

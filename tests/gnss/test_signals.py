from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.gnss.signals import (
    band,
    constellation,
    frequency_hz,
    known,
    select,
)
from fgnav.types.observations import Observations


def observed(channels: list[tuple[str, str]], tracked: np.ndarray) -> Observations:
    """Return one epoch of antennas (a, c) that track channels or not."""
    there = np.where(tracked, 1.0, np.nan)[None]
    return Observations(
        t_s=[0.0],
        tag_s=np.zeros((1, len(tracked))),
        satellites=tuple(s for s, _ in channels),
        signals=tuple(g for _, g in channels),
        code_m=there,
        phase_cycles=there,
        doppler_hz=there,
        cn0_dbhz=there,
        lock_flags=np.zeros(there.shape),
    )


@pytest.mark.parametrize(
    ("satellite", "signal", "hz"),
    [
        ("G05", "1C", 1575.42e6),
        ("G05", "2W", 1227.60e6),
        ("G05", "5Q", 1176.45e6),
        ("E11", "1X", 1575.42e6),
        ("E11", "7Q", 1207.14e6),
        ("C19", "2I", 1561.098e6),
        ("C19", "1I", 1561.098e6),  # as RINEX 3.02 wrote B1I
        ("C19", "1P", 1575.42e6),
        ("C19", "5P", 1176.45e6),
        ("C19", "6I", 1268.52e6),
        ("C19", "7I", 1207.14e6),
        ("J02", "1C", 1575.42e6),
    ],
)
def test_carriers_are_those_of_the_rinex_tables(satellite, signal, hz):
    assert frequency_hz(satellite, signal) == hz


def test_unknown_constellation_is_named():
    with pytest.raises(BadInputError, match="satellite 'R07': only GPS, Galileo, BeiDou, QZSS"):
        constellation("R07")


def test_unknown_band_is_named():
    assert not known("G05", "9Z")
    with pytest.raises(BadInputError, match="signal '9Z' of G05: its carrier is not known"):
        frequency_hz("G05", "9Z")


def test_old_and_new_b1i_share_a_band():
    assert band("C06", "1I") == band("C06", "2I") == "2"
    assert constellation("C06") == "BeiDou"


def test_one_signal_per_carrier_is_chosen_and_the_rest_is_counted():
    channels = [("G01", "1C"), ("G01", "1W"), ("G02", "1C"), ("R01", "1C")]
    chosen = select(observed(channels, np.ones((2, 4), dtype=bool)))
    assert chosen.satellites == ("G01", "G02")
    assert chosen.signals == ("1C", "1C")
    lost = {(loss.what, loss.reason): loss.count for loss in chosen.unused}
    assert lost == {
        ("G 1W observation", "another signal of the same carrier is used"): 2,
        (
            "R 1C observation",
            "the carrier differs from satellite to satellite: code alone serves, for positions",
        ): 2,
    }


def test_glonass_is_chosen_where_code_alone_serves():
    channels = [("G01", "1C"), ("R01", "1C"), ("R02", "2C")]
    chosen = select(observed(channels, np.ones((2, 3), dtype=bool)), code_alone=True)
    assert chosen.satellites == ("G01", "R01", "R02")
    assert frequency_hz("R02", "2C") == 1246.0e6


def test_two_ways_to_track_one_carrier_make_one_channel():
    channels = [("E01", "1C"), ("E01", "1X"), ("E02", "1C"), ("E02", "1X")]
    tracked = np.array([[True, False, True, False], [False, True, False, True]])
    chosen = select(observed(channels, tracked))
    assert chosen.satellites == ("E01", "E02")
    assert chosen.signals == ("1C", "1C")
    np.testing.assert_array_equal(chosen.channel, [[0, 2], [1, 3]])
    assert chosen.unused == ()


def test_a_signal_all_antennas_track_goes_before_a_more_frequent_one():
    channels = [("G01", "2W"), ("G01", "2L"), ("G02", "2W"), ("G02", "2L"), ("G03", "2L")]
    tracked = np.array([[True, True, True, True, True], [True, False, True, False, False]])
    chosen = select(observed(channels, tracked))
    assert chosen.signals == ("2W", "2W")
    assert sum(loss.count for loss in chosen.unused) == 3


@pytest.mark.parametrize("causal", [False, True])
def test_a_signal_with_phases_goes_before_one_with_codes_alone(causal):
    flight = observed([("G01", "1C"), ("G01", "1W")], np.ones((2, 2), dtype=bool))
    phases = flight.phase_cycles.copy()
    phases[..., 0] = np.nan
    chosen = select(replace(flight, phase_cycles=phases), causal=causal)
    assert chosen.signals == ("1W",)


@pytest.mark.parametrize("causal", [False, True])
def test_a_base_takes_the_signal_of_the_rover_where_it_has_it(causal):
    channels = [("G01", "2W"), ("G02", "2W"), ("G01", "2X")]
    base = observed(channels, np.ones((1, 3), dtype=bool))
    assert select(base, causal=causal).signals == ("2W", "2W")
    of_rover = {("G", "2"): "2X", ("E", "1"): "1C"}
    assert select(base, causal=causal, preferred=of_rover).signals == ("2X",)
    assert select(base, causal=causal, preferred={("G", "2"): "2L"}).signals == ("2W", "2W")


def test_nothing_observed_selects_nothing():
    chosen = select(observed([("G01", "1C")], np.zeros((2, 1), dtype=bool)))
    assert chosen.satellites == ()
    assert chosen.channel.shape == (2, 0)

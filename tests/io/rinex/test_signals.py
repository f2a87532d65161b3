"""Which signals are kept."""

from pathlib import Path

import pytest

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.signals import choose_signals, same_signal


def header(version=3.04, **types) -> Header:
    return Header(
        path=Path("a.rnx"),
        version=version,
        system="M",
        types={letter: tuple(names.split()) for letter, names in types.items()},
        time_system="GPS",
        last_us=None,
        interval_s=None,
        klobuchar=(0.0,) * 8,
        size=0,
        content=(),
    )


def test_one_signal_per_carrier_is_kept_best_first():
    choice = choose_signals([header(G="C1W L1W C1C L1C C2W L2W C2X L2X C5X L5X")])[0]
    assert choice.kept["G"] == (("1C",), ("2W",), ("5X",))
    assert choice.kept["E"] == ((), (), ())
    assert choice.column("G", "D2W") == (1, 2, "2W")
    assert choice.column("G", "L1W") == (-1, 1, "1W")
    assert choice.column("G", "X1") == (-1, -1, "1")


def test_signal_with_phase_goes_before_one_with_code_only():
    assert choose_signals([header(G="C1C C1W L1W")])[0].kept["G"][0] == ("1W",)
    assert choose_signals([header(G="C1C")])[0].kept["G"][0] == ("1C",)


def test_signal_that_all_receivers_share_goes_first():
    first = header(G="C1C L1C C1W L1W", C="C7I L7I C7Z L7Z")
    second = header(G="C1W L1W", C="C7Z L7Z")
    kept = [choice.kept for choice in choose_signals([first, second])]
    assert [k["G"][0] for k in kept] == [("1W",)] * 2
    assert [k["C"][1] for k in kept] == [("7Z",)] * 2


def test_pilot_and_combined_tracking_are_the_same_signal():
    assert same_signal("E", "1X") == same_signal("E", "1C") != same_signal("E", "1A")
    assert same_signal("G", "2W") != same_signal("G", "2X")
    first, second = header(E="C1C L1C C5Q L5Q"), header(E="C1X L1X C5X L5X")
    kept = [choice.kept["E"] for choice in choose_signals([first, second])]
    assert kept == [(("1C",), (), ("5Q",)), (("1X",), (), ("5X",))]


def test_unknown_attributes_get_no_choice():
    assert choose_signals([header(G="C1Q L1Q", J="C1C L1C")])[0].kept["G"][0] == ()


def test_phases_without_a_code_are_chosen_too():
    assert choose_signals([header(G="L1C D1C")])[0].kept["G"][0] == ("1C",)
    assert choose_signals([header(version=2.11, E="L1 D1")])[0].kept["E"][0] == ("1X",)


def test_signals_of_rinex_2_are_all_that_its_codes_may_be():
    choice = choose_signals([header(version=2.11, G="C1 P1 L1 L2 P2 C2", E="C1 C7 L8")])[0]
    assert choice.kept["G"] == (("1C", "1W"), ("2W", "2X"), ())
    assert choice.kept["E"] == (("1X",), ("7X",), ())
    assert choice.column("G", "P1") == (0, 0, "1W")
    assert choice.column("G", "L2") == (1, 1, "2W")
    assert choice.column("E", "L8") == (-1, 1, "8X")
    assert choice.column("E", "P1") == (-1, 0, "1")


def test_signals_that_are_wanted_are_kept_under_any_name_and_no_others():
    headers = [header(G="C1C L1C C2W L2W", E="C1X L1X C6C L6C"), header(E="C6B L6B")]
    first, second = choose_signals(headers, {"E": ["6C"]})
    assert first.kept["E"] == (("6C",),)
    assert second.kept["E"] == (("6B",),)
    assert first.kept["G"] == ()
    assert first.column("E", "L6C") == (0, 1, "6C")
    text = "key gnss.signals: no E signal 8X was observed; there are E 1X, E 6B, E 6C, G 1C, G 2W"
    with pytest.raises(BadInputError, match=text):
        choose_signals(headers, {"E": ["8X"]})

"""Keyframes of a flight are collected once for methods that ask alike, and not kept beyond it."""

import gc
import weakref
from dataclasses import replace

from fgnav.integers.lambda_ import Lambda
from fgnav.methods.smoother.collect import Settings, collect
from tests.gnss.based import flown

SETTINGS = Settings(
    resolver=Lambda(),
    gravity=None,
    angular_acceleration_density=0.01,
    sub_steps=2,
    false_alarm=1e-4,
)


def test_methods_that_ask_alike_share_what_was_collected():
    flight = replace(flown(base=None, span_s=3.0))
    first = collect(flight, SETTINGS)
    assert collect(flight, SETTINGS) is first
    other = collect(flight, replace(SETTINGS, sub_steps=1))
    assert other is not first
    assert len(other.keyframes.t_s) == len(first.keyframes.t_s)


def test_what_was_collected_goes_with_its_flight():
    flight = replace(flown(base=None, span_s=3.0))
    known = weakref.ref(flight)
    collect(flight, SETTINGS)
    del flight
    gc.collect()
    assert known() is None

"""A campaign that takes a second, and a source of flights that needs no simulator."""

import msgspec
import pytest

from fgnav.campaign.order import Order

SMALL = {
    "name": "small",
    "seed": 7,
    "flights": 3,
    "baseline": "loud",
    "method": [
        {"name": "quiet", "method": "maximum-likelihood", "integers": "truth"},
        {"name": "loud", "method": "closed-form", "integers": "truth"},
    ],
    "case": [
        {
            "name": "sine",
            "scenario": "demo",
            "any_hour": True,
            "changes": {"duration_s": 1.0},
            "sweep": {
                "name": "amplitude_deg",
                "values": [5.0, 20.0],
                "keys": {"motion.roll.amplitude_deg": True},
            },
        },
        {"name": "again", "scenario": "demo", "changes": {"duration_s": 1.0}},
    ],
}


@pytest.fixture
def order() -> Order:
    return msgspec.convert(SMALL, Order)

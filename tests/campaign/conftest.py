"""A campaign that takes a second, and what comes of it in this process."""

import msgspec
import pytest

from fgnav.campaign.conduct import conduct
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


def here(work, tasks, lost):  # noqa: ARG001
    """Work off in this process: an engine."""
    for task in tasks:
        yield work(task)


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("campaign") / "whole"
    return conduct(msgspec.convert(SMALL, Order), out, here), out

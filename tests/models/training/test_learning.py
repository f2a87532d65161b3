"""What recipes of networks that measure have in common."""

import numpy as np

from fgnav_models.training.learning import Learning


def test_a_domain_spans_what_training_saw_but_for_a_few():
    seen = {
        "speed_mps": np.linspace(-100.0, 100.0, 2001),
        "change_mps2": np.linspace(1.0, 3.0, 201),
    }
    units = {"change_mps2": "m/s2", "speed_mps": "m/s"}
    speed, change = Learning(domain_percent=5.0).domain(units, seen, ("change_mps2",))
    assert (speed.name, speed.unit, speed.range) == ("speed_mps", "m/s", (-90.0, 90.0))
    assert change.range == (0.0, 2.9)  # calmer than any is no other world

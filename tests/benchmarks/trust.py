"""Time per epoch of ``--integers network`` beside ``constrained``; its errors are on its card.

Sites and times anywhere, code 1 m and phase 3 mm at the zenith over the sine of the elevation, one
link in twelve 1.5 m and 15 mm worse.
"""

from functools import partial

import msgspec
import numpy as np

from fgnav.integers.resolvers.constrained import Constrained
from fgnav_models.runtime.resolver import Network
from fgnav_models.training.trust.data import Draw, drawn_epochs
from fgnav_models.training.trust.trials import flight_of
from tests.benchmarks._rows import Row, row, timed

EPOCHS = 300
L1_L5 = {"G": ("1C", "5Q"), "E": ("1C", "5Q")}
WORLDS = {
    "few": Draw(arrays=1, epochs=EPOCHS, signals=({"G": ("1C",)},), satellites=(5, 5)),
    "pair": Draw(arrays=1, epochs=EPOCHS, signals=({"G": ("1C",), "E": ("1C",)},), antennas=(2, 2)),
    "modern": Draw(arrays=1, epochs=EPOCHS, signals=(L1_L5,), satellites=(20, 20), antennas=(8, 8)),
}
NAMES = tuple(f"trust_{name}" for name in WORLDS)
SAME = {"code_m": (1.0, 1.0), "phase_m": (0.003, 0.003), "outliers": (0.08, 0.08)}


def run() -> list[Row]:
    """Time both resolvers on each world."""
    rows = []
    for name, draw in WORLDS.items():
        differences, _ = drawn_epochs(
            msgspec.structs.replace(draw, **SAME), np.random.default_rng(5)
        )
        flight = flight_of(differences)
        works = [partial(resolver, differences, flight) for resolver in (Network(), Constrained())]
        ours_ms, peer_ms = timed(works, 3).min(axis=0) * 1e3 / EPOCHS
        note = (
            f"{differences.phase_m.shape[1] + 1} antennas, {len(differences.satellites)} channels"
        )
        note += "; peer: constrained"
        rows.append(row(f"trust_{name}", ours_ms, peer_ms, "ms", note, less=True))
    return rows

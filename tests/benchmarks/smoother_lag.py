"""What a window of two seconds gives away against the whole flight at once: RMS errors, five seeds.

The demo's motion with angles that swing by 20 and by 45 degrees, a minute each.
``SMOOTHER_LAG_FLIGHTS`` in the environment states another number of seeds.
"""

import os
from pathlib import Path

import msgspec
import numpy as np

from fgnav.evaluation.comparison import compare
from fgnav.methods.smoother import Batch, Smoother
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

SCENARIO = Path(__file__).resolve().parents[2] / "sim" / "fgnav_sim" / "scenarios" / "demo.toml"
AMPLITUDES_DEG = (20, 45)
SEEDS = range(20_000, 20_000 + int(os.environ.get("SMOOTHER_LAG_FLIGHTS", "5")))
LAG_S = 2.0
ANGLES = ("roll", "pitch", "yaw")
NAMES = tuple(f"smoother_lag_{amplitude}" for amplitude in AMPLITUDES_DEG)


def run() -> list[dict[str, object]]:
    """Return a row for each amplitude, errors of all angles together."""
    return [_row(amplitude) for amplitude in AMPLITUDES_DEG]


def _row(amplitude_deg: int) -> dict[str, object]:
    squares = np.mean([rmse_deg(amplitude_deg, seed) ** 2 for seed in SEEDS], axis=0)
    window, batch = np.sqrt(squares)
    angles = ", ".join(
        f"{angle} {ours:.4f}/{peer:.4f}"
        for angle, ours, peer in zip(ANGLES, window, batch, strict=True)
    )
    ours, peer = np.sqrt(squares.sum(axis=1))
    return {
        "name": f"smoother_lag_{amplitude_deg}",
        "ours": float(ours),
        "peer": float(peer),
        "ratio": float(peer / ours),
        "unit": "deg",
        "note": f"RMS of a window of {LAG_S:g} s; peer: batch; {len(SEEDS)} seeds; {angles}",
    }


def rmse_deg(amplitude_deg: float, seed: int) -> np.ndarray:
    """Return RMS errors of the angles by window and batch, (2, 3)."""
    scenario = load_scenario(SCENARIO)
    swing = msgspec.structs.replace(scenario.motion.roll, amplitude_deg=float(amplitude_deg))
    motion = msgspec.structs.replace(scenario.motion, roll=swing, pitch=swing, yaw=swing)
    scenario = msgspec.structs.replace(scenario, motion=motion)
    flight = simulate(scenario, np.random.default_rng(seed))
    methods = [Smoother(lag_s=LAG_S), Batch()]
    figures = compare(flight, methods).to_dict()["methods"]
    return np.array([[figures[m.name]["rmse_deg"][angle] for angle in ANGLES] for m in methods])

"""Modules that hand on what a perfect sensor of each quantity records, with noise."""

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from fgnav import Batch
from fgnav.evaluation.reference import truth_at
from fgnav.geometry.rotations import transpose
from fgnav.neural.records import Record
from fgnav_models import learn
from tests.models.learn.small import RATE_HZ, Sensor, flown
from tests.turns import GYROSCOPE

OVER_S, SIGMA = 1.0, 0.02


def said(flight, measures, frame, rng):
    """Return what a perfect sensor of a quantity records, with noise, and its unit."""
    truth = flight.truth
    t_s = np.arange(truth.t_s[0] + OVER_S, truth.t_s[-1], 1 / RATE_HZ)
    now, before = truth_at(truth, t_s), truth_at(truth, t_s - OVER_S)
    R_bn = transpose(now.R_nb)
    if measures == "velocity":
        values = now.v_n_mps if frame == "n" else np.einsum("nij,nj->ni", R_bn, now.v_n_mps)
    elif measures == "displacement":
        values = now.p_n_m - before.p_n_m
        if frame == "b":
            values = np.einsum("nji,nj->ni", before.R_nb, values)
    elif measures == "attitude":
        values = Rotation.from_matrix(now.R_nb).as_quat(scalar_first=True)
    else:
        values = {
            "direction": now.R_nb[:, 2],
            "heading": np.stack([now.R_nb[:, 0, 0], now.R_nb[:, 1, 0]], axis=1),
            "speed": np.linalg.norm(now.v_n_mps, axis=1)[:, None],
            "height": -now.p_n_m[:, 2:],
            "position": now.p_n_m,
        }[measures]
    return t_s, values + SIGMA * rng.standard_normal(values.shape)


CASES = [
    ("velocity", "b", "cholesky", {}),
    ("velocity", "b", "log_sigma", {"lasting": 0.3, "half_life_s": 0.1}),
    ("velocity", "n", "log_sigma", {}),
    ("displacement", "b", "cholesky", {"over_s": OVER_S}),
    ("displacement", "n", "log_sigma", {"over_s": OVER_S, "half_life_s": 0.2}),
    ("direction", "b", "log_sigma", {}),
    ("attitude", "n", "cholesky", {"lasting": 0.2}),
    ("heading", "n", "log_sigma", {}),
    ("speed", "n", "log_sigma", {}),
    ("height", "n", "log_sigma", {}),
    ("position", "n", "cholesky", {}),
]
UNIT = ("attitude", "direction")
FREEDOM = {"heading": 1, "speed": 1, "height": 1}
CHANNELS = {"attitude": 4, "heading": 2}


def sensed(module, flight, measures, frame, rng, **more):
    """Return a module's factor, with the record that it sees."""
    t_s, values = said(flight, measures, frame, rng)
    seen = learn.input_of("sensor", values[:, None], RATE_HZ, unit="unit", frame=frame)
    d = values.shape[1]
    plain = {"mean": (0.0,) * d, "scale": (1.0,) * d, "range": ((-1e4, 1e4),) * d}
    inputs = [msgspec.structs.replace(seen, **plain)]
    record = Record(t_s=t_s, values=values, unit="unit", frame=frame)
    return learn.factor(module, measures, inputs, frame=frame, records={"sensor": record}, **more)


def drawn(seed, *, gyroscope=True):
    """Return a training flight, a factor of a live module, and weights of what is looked at."""
    measures, frame, form, more = CASES[seed]
    figures = {"accelerometer_noise_mps2_per_sqrt_hz": 0.01}
    if not gyroscope:
        figures |= dict.fromkeys(GYROSCOPE)
    flight, rng = flown(seed, duration_s=8.0, **figures), np.random.default_rng(seed)
    f = FREEDOM.get(measures, 3)
    uncertain = f * (f + 1) // 2 if form == "cholesky" else f
    module = Sensor(CHANNELS.get(measures, f), uncertain, seed, unit=measures in UNIT)
    factor = sensed(module, flight, measures, frame, rng, covariance=form, **more)
    return learn.training_flight(flight, Batch(noise="nominal")), factor, module, rng

"""Accuracy of a gravity network on flights it never saw, by kind of flight, as tables of a card."""

from dataclasses import dataclass

import msgspec
import numpy as np
import torch

from fgnav.checks import FloatArray, IntArray
from fgnav.evaluation.networks import Calibration
from fgnav.evaluation.paired import Interval, pooled
from fgnav.types.flight import Flight
from fgnav_models.training.gravity.data import BASELINES, Rows, angles_deg, baseline, rms
from fgnav_models.training.gravity.features import (
    GRAVITY_MPS2,
    VELOCITIES,
    VELOCITY_HZ,
    CourseMotion,
)
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_models.training.order import markdown_table
from fgnav_sim.data_sets.gravity import PHASES, GravityEpochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate

_CHUNK = 20_000  # windows answered at a time
_LEAST = 100  # windows of a kind, below which its figures say nothing
_BINS = 4
# The simulator's scenarios of flown bodies, none of which has taught anything
SCENARIOS = ("rocket", "coast", "glider")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Answers:
    """A network's answers to windows."""

    g_b: FloatArray  # (n, 3)
    covariance: FloatArray  # (n, 3, 3)

    @classmethod
    def of(cls, net: GravityNet, epochs: GravityEpochs) -> "Answers":
        """Return the answers of a network on the CPU to all windows."""
        rows = Rows.of(epochs)
        g_b, covariance = [], []
        with torch.no_grad():
            for first in range(0, len(rows), _CHUNK):
                chunk = slice(first, first + _CHUNK)
                answer = net(*(tensor[chunk] for tensor in rows.seen(aided=net.aided)))
                g_b.append(answer[0].double().numpy())
                covariance.append(answer[1].double().numpy())
        return cls(g_b=np.concatenate(g_b), covariance=np.concatenate(covariance))

    @property
    def sigma_rad(self) -> FloatArray:
        """Return the stated sigma of each axis across the answer, (n,)."""
        return np.asarray(np.sqrt(np.einsum("nii->n", self.covariance) / 2))

    def level(self, epochs: GravityEpochs) -> tuple[FloatArray, FloatArray]:
        """Return errors and covariances in the axes north and east, as calibration has them."""
        axes = epochs.R_nb[:, :2]
        error = np.einsum("nij,nj->ni", axes, self.g_b)
        return error, axes @ self.covariance @ axes.swapaxes(1, 2)


def by_kind(
    net: GravityNet, epochs: GravityEpochs, most_rad: float
) -> tuple[str, dict[str, float]]:
    """Return a table of kinds of flight and the figures of all together.

    NEES is of one degree of freedom, of windows whose stated sigma is within the limit; what the
    constant covariance, the best of each kind, loses in likelihood is a mean over flights.
    """
    answers = Answers.of(net, epochs)
    error, P = answers.level(epochs)
    within = answers.sigma_rad <= most_rad
    degrees = {"network": angles_deg(answers.g_b, epochs.g_b)}
    degrees |= {
        name: angles_deg(baseline(name, epochs), epochs.g_b)
        for name in (BASELINES[0], "physical pair")
    }
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[:, :, None])[:, :, 0])
    rows, rng = [], np.random.default_rng(0)
    for k, kind in enumerate(PHASES):
        of_kind = within & (epochs.phase == k)
        share = of_kind.sum() / max((epochs.phase == k).sum(), 1)
        if of_kind.sum() < _LEAST:
            rows.append([kind, f"{100 * share:.0f} %", *["–"] * 5])
            continue
        gain = _gain(error[of_kind], P[of_kind], epochs.flight[of_kind], rng)
        rows.append(
            [
                kind,
                f"{100 * share:.0f} %",
                *(f"{rms(errors[of_kind]):.2f}" for errors in degrees.values()),
                f"{squared[of_kind].mean() / 2:.2f}",
                f"{gain.value:+.2f} ({gain.low:+.2f} to {gain.high:+.2f})",
            ]
        )
    heads = ("kind", "answered", *(f"{name}, RMS deg" for name in degrees), "NEES of 1")
    metrics = {f"{name}, RMS deg": rms(errors[within]) for name, errors in degrees.items()}
    metrics |= {
        "windows answered, %": 100.0 * float(within.mean()),
        "network, NEES of 1": float(squared[within].mean() / 2),
    }
    return markdown_table((*heads, "NLL less the best constant's"), rows), metrics


def _gain(error: FloatArray, P: FloatArray, flight: IntArray, rng: np.random.Generator) -> Interval:
    """Return the difference of mean NLL per flight, network less the best constant covariance."""
    nll, constant = (_nll(error, covariance) for covariance in (P, error.T @ error / len(error)))
    _, number = np.unique(flight, return_inverse=True)
    counts = np.bincount(number)
    return pooled(np.bincount(number, nll - constant) / counts, rng, squared=False)


def _nll(error: FloatArray, P: FloatArray) -> FloatArray:
    P = np.broadcast_to(P, (len(error), 2, 2))
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[:, :, None])[:, :, 0])
    return np.asarray((squared + np.linalg.slogdet(2 * np.pi * P)[1]) / 2)


def free_flight(net: GravityNet, epochs: GravityEpochs, world: GravityWorld) -> str:
    """Return a table of windows of a coasting rocket beside a bound on what they can tell.

    Without thrust the accelerometer feels the air alone, nearly along the axis. The roll is in what
    is lateral of it, the window's mean F: velocities have its direction with the sigma of a fitted
    line's slope, the accelerometer with that of its bias, so that the roll has the sigma
    hypot(slope, bias) / F, at most that of an unknown angle. The nose follows the velocity
    less the wind w, which a window does not show. At a path's slope gamma down errs by
    cos(gamma) sin(roll) and, in each of two axes, by sin(gamma) w / v.
    """
    rocket = PHASES.index("rocket")
    coast = np.abs(epochs.f_b_mps2[:, :, 0]).max(axis=1) < GRAVITY_MPS2
    coasting = epochs[(epochs.phase == rocket) & coast]
    if len(coasting) < _LEAST:
        return "None of the windows is of one."
    answers = Answers.of(net, coasting)
    with torch.no_grad():
        motion = CourseMotion()(torch.from_numpy(coasting.v_n_mps).double())
    velocity, mean = motion.velocity.numpy(), motion.mean_force().numpy()
    n, bias_mps2 = VELOCITIES, world.imu.accelerometer_bias_mps2
    slope = np.sqrt(12 / (n * (n**2 - 1))) * VELOCITY_HZ * world.velocity_noise_mps[0]
    force = np.linalg.norm(np.cross(mean, velocity), axis=1) / np.linalg.norm(velocity, axis=1)
    roll = np.minimum(np.hypot(slope, bias_mps2) / force, np.pi / np.sqrt(3))
    winds = (world.bodies.wind_mps, world.bodies.wind_aloft_mps)
    wind = np.sqrt(np.mean([np.square(np.linspace(*wind)).mean() for wind in winds]) / 2)
    speed = np.linalg.norm(velocity, axis=1)
    level, steep = velocity[:, 0] / speed, velocity[:, 2] / speed
    across = level * np.sin(np.minimum(roll, np.pi / 2))
    bound = np.degrees(np.sqrt(across**2 + 2 * (steep * np.minimum(wind / speed, 1.0)) ** 2))
    degrees, stated = angles_deg(answers.g_b, coasting.g_b), np.degrees(answers.sigma_rad)
    rows = [
        [
            f"{bound[bin_rows].min():.1f} to {bound[bin_rows].max():.1f}",
            f"{rms(bound[bin_rows]):.1f}",
            f"{rms(degrees[bin_rows]):.1f}",
            f"{np.sqrt(2) * rms(stated[bin_rows]):.1f}",
        ]
        for bin_rows in np.array_split(np.argsort(bound), _BINS)
    ]
    heads = ("bound, deg", "its RMS", "network's error, RMS", "stated")
    return markdown_table(heads, rows)


def flown_scenario(name: str, count: int, seed: list[int]) -> list[Flight]:
    """Return flights of a scenario of the simulator with velocities in place of its receivers."""
    fixes = FixesTable(rate_hz=VELOCITY_HZ)
    scenario = msgspec.structs.replace(load_scenario(name), gnss=None, fixes=fixes)
    rngs = np.random.default_rng(seed).spawn(count)
    return [simulate(scenario, rng) for rng in rngs]


def calibrated(calibration: dict[str, Calibration]) -> str:
    """Return a table of calibrations by name.

    "Together" is the NEES of the mean of a flight's answers, counted as the factor counts them.
    """
    rows = [
        [
            name,
            f"{figure.count} of {figure.count + figure.outside}",
            f"{figure.network.nees:.2f}",
            f"{figure.network.nll:.2f}",
            f"{figure.constant.nll:.2f}",
            f"{np.degrees(figure.network.energy):.2f}",
            f"{np.degrees(figure.constant.energy):.2f}",
            f"{figure.together[0]:.2f}",
        ]
        for name, figure in calibration.items()
    ]
    heads = ("flights", "answers", "NEES of 1", "NLL", "constant's", "energy, deg", "constant's")
    return markdown_table((*heads, "together"), rows)

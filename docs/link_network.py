"""A network that states standard deviations of GNSS links, and flights for it to learn from.

It sees elevation, C/N0 and the change of code less phase. It is trained alone, by the likelihood of
double differences at the truth, or through the closed form of an epoch's attitude, by that of its
error as well. ``link_weights`` compares it with others.
"""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import pairwise

import msgspec
import numpy as np
import torch

import fgnav
from fgnav.checks import BoolArray, FloatArray
from fgnav.evaluation.reference import truth_at
from fgnav.gnss.single_differences import SingleDifferences, single_differences
from fgnav.gnss.undifferenced import Undifferenced
from fgnav_sim.gnss.tables import (
    Cn0Table,
    GnssTable,
    LossOfLockTable,
    MultipathTable,
    OutageTable,
    ReflectorTable,
)
from fgnav_sim.motion import Arc, Motion, Sine
from fgnav_sim.ranges import log_uniform
from fgnav_sim.scenario import ImuTable, Place, Scenario
from fgnav_sim.simulate import simulate

SEED = 5_056
WINDOW_S = 2.0  # to both sides of an epoch
STEPS, FLIGHTS, WIDTH = 1000, 3, 32  # of a step: flights
EPOCHS, LEAST = 12, 12  # of a flight to learn from, and links of each of them
DIFFUSE = 1e3  # variance of clocks over that of links
PRIOR_RAD = 0.1  # of an epoch's attitude: antennas nearly in a line leave an angle open


def drawn(rng: np.random.Generator) -> Scenario:
    """Return a flight with a place, time, array, mirrors, blocked sky and noise of its own."""
    box_m = rng.uniform(0.5, 1.6) * np.array([1.5, 1.0, 0.2])
    antennas_b_m = box_m * rng.uniform(-0.5, 0.5, (rng.integers(3, 5, endpoint=True), 3))
    antennas_b_m[:2] = np.zeros(3), 0.5 * box_m
    mirrors = []
    for _ in range(rng.integers(1, 4)):
        normal_b = rng.standard_normal(3)
        normal_b *= [1.0, 1.0, -np.sign(normal_b[2])] / np.linalg.norm(normal_b)  # to the sky
        point_b_m = 0.15 * box_m * rng.uniform(-1, 1, 3) - rng.uniform(0.1, 0.6) * normal_b
        x, y, z = point_b_m.tolist()
        mirror = ReflectorTable(
            point_b_m=(x, y, z),
            normal_b=tuple(normal_b.tolist()),
            amplitude=log_uniform((0.05, 0.35), rng),
            radius_m=rng.uniform(0.5, 2.0),
        )
        mirrors.append(mirror)
    azimuth_deg, width_deg = rng.uniform(0, 360), rng.uniform(60, 160)
    code_m, phase_m = log_uniform((0.2, 0.8), rng), log_uniform((0.0015, 0.003), rng)
    letters = ("G", "E", "C")[: rng.integers(1, 3, endpoint=True)]
    gnss = GnssTable(
        rate_hz=5.0,
        signals={letter: ("2I" if letter == "C" else "1C",) for letter in letters},
        code_noise_m=code_m,
        phase_noise_m=phase_m,
        cn0=Cn0Table(
            horizon_dbhz=rng.uniform(30, 36), zenith_dbhz=rng.uniform(47, 51), sets_noise=True
        ),
        antenna_noise=tuple(np.exp(rng.uniform(-0.2, 0.3, len(antennas_b_m))).tolist()),
        outages=(
            OutageTable(
                azimuth_deg=(azimuth_deg, (azimuth_deg + width_deg) % 360),
                elevation_deg=(-90.0, rng.uniform(25, 55)),
            ),
        ),
        multipath=MultipathTable(
            code_m=rng.uniform(0.1, 0.8) * code_m,
            phase_m=rng.uniform(0.1, 0.8) * phase_m,
            time_constant_s=log_uniform((5.0, 40.0), rng),
        ),
        reflectors=tuple(mirrors),
        message_errors=True,
        loss_of_lock=LossOfLockTable(rate_per_hour=20.0),
    )
    roll, pitch, yaw = (
        Sine(amplitude_deg=rng.uniform(5, 25), rate_radps=rng.uniform(0.3, 1.2)) for _ in range(3)
    )
    path = Arc(speed_mps=rng.uniform(20, 100), radius_m=rng.uniform(200, 900))
    return Scenario(
        start=datetime(2020, 6, 25) + timedelta(days=rng.uniform(0, 300)),
        duration_s=20.0,
        origin=Place(latitude_deg=rng.uniform(-60, 60), longitude_deg=rng.uniform(-180, 180)),
        motion=Motion(path=path, roll=roll, pitch=pitch, yaw=yaw),
        antennas_b_m=tuple(map(tuple, antennas_b_m.tolist())),
        gnss=gnss,
        imu=ImuTable(),
    )


def flown(scenario: Scenario, seed: list[int]) -> fgnav.Flight:
    """Return the flight, its C/N0 as receivers give it: with noise, in quarters of a decibel."""
    rng = np.random.default_rng(seed)
    flight = simulate(scenario, rng)
    seen = flight.observations
    noise_db = rng.uniform(0.1, 0.5) * rng.standard_normal(seen.cn0_dbhz.shape)
    cn0_dbhz = np.round(4 * (seen.cn0_dbhz + noise_db)) / 4
    return replace(flight, observations=replace(seen, cn0_dbhz=cn0_dbhz))


def columns(flight: fgnav.Flight, of: SingleDifferences | Undifferenced) -> list[int]:
    """Return the places of channels among a flight's observations."""
    seen = flight.observations
    pairs = list(zip(seen.satellites, seen.signals, strict=True))
    return [pairs.index(pair) for pair in zip(of.satellites, of.signals, strict=True)]


def link_inputs(flight: fgnav.Flight, single: SingleDifferences) -> tuple[FloatArray, BoolArray]:
    """Return what receivers know of their links, (n, a, m, f), and which there are.

    The second is the RMS of C/N0 about its line in the sine of the elevation, dB; the third that of
    what antennas have of a satellite less their mean, which knows nothing of its power.
    """
    seen, channel = flight.observations, columns(flight, single)
    present = single.code_there & single.phase_there & np.isfinite(single.elevation_rad)[:, None]
    sine = np.broadcast_to(np.sin(single.elevation_rad)[:, None], present.shape)
    off_db = np.where(present, seen.cn0_dbhz[:, :, channel], np.nan)
    for antenna, here in enumerate(present.swapaxes(0, 1)):
        line = np.polynomial.Polynomial.fit(sine[:, antenna][here], off_db[:, antenna][here], 1)
        off_db[:, antenna] -= line(sine[:, antenna])
    antennas = present.sum(axis=1, keepdims=True)
    apart_db = (off_db - mean_of(off_db, 1)) * np.sqrt(antennas / (antennas - 1).clip(1))
    for carrier in range(single.group.max() + 1):
        of_carrier = apart_db[:, :, single.group == carrier]
        apart_db[:, :, single.group == carrier] = of_carrier - mean_of(of_carrier, (0, 2))
    phase_m = seen.phase_cycles[:, :, channel] * single.wavelength_m
    step_m = np.diff(seen.code_m[:, :, channel] - phase_m, axis=0, prepend=np.nan) / np.sqrt(2)
    step_m = np.where(present & (abs(step_m) < 20.0), step_m, np.nan)  # but for slips
    code_m, phase_sigma_m = (
        np.sqrt(getattr(single, f"{kind}_variance_m2"))[:, None] for kind in ("code", "phase")
    )
    half = round(WINDOW_S / float(np.median(np.diff(seen.t_s))))
    deviation_db, apart_db, spread_m = (moving_rms(x, half) for x in (off_db, apart_db, step_m))
    of_channel_db, of_flight_db = (
        np.sqrt(mean_of(deviation_db**2, axes)) for axes in (1, (0, 1, 2))
    )
    inputs = (
        sine,
        deviation_db,
        apart_db,
        *(np.log(x.clip(0.05)) for x in (deviation_db, apart_db, of_channel_db, of_flight_db)),
        np.log((spread_m / code_m).clip(0.05)),
        np.log(code_m),
        np.log(phase_sigma_m),
        np.log(present.sum(axis=(1, 2), keepdims=True)),
    )
    every = np.stack([np.broadcast_to(one, present.shape) for one in inputs], axis=-1)
    return np.nan_to_num(every), present


def mean_of(values: FloatArray, axes: int | tuple[int, ...]) -> FloatArray:
    """Return the mean of what is finite over axes, which stay; NaN of nothing."""
    is_finite = np.isfinite(values)
    count = is_finite.sum(axis=axes, keepdims=True)
    total = np.where(is_finite, values, 0.0).sum(axis=axes, keepdims=True)
    return np.where(count > 0, total / count.clip(1), np.nan)


def moving_rms(values: FloatArray, half: int) -> FloatArray:
    """Return the RMS of what is finite about each epoch, (n, ...); NaN of nothing."""
    padded = np.pad(values, ((half, half), (0, 0), (0, 0)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0)
    return np.sqrt(mean_of(windows**2, -1)[..., 0])


@dataclass(frozen=True, slots=True)
class Sample:
    """Links of k epochs of a flight, (k, q): inputs, and errors at the truth."""

    inputs: torch.Tensor  # (k, q, f)
    present: torch.Tensor
    error_m: dict[str, torch.Tensor]  # of code and phase
    sigma_m: dict[str, torch.Tensor]  # by elevation
    # (q, q); whether two links are of one channel, and of one antenna and carrier
    of_channel: torch.Tensor
    of_antenna: torch.Tensor
    design_m: torch.Tensor  # (k, q, 3); by the attitude in body axes

    @classmethod
    def drawn(cls, seed: list[int]) -> "Sample":
        """Draw a flight; the one without noise and echoes gives its links' errors."""
        scenario = drawn(np.random.default_rng(seed))
        flight, noise = flown(scenario, seed), ("code_noise_m", "phase_noise_m")
        calm = msgspec.structs.replace(
            scenario.gnss, multipath=None, reflectors=(), **dict.fromkeys(noise, 1e-9)
        )
        clean = flown(msgspec.structs.replace(scenario, gnss=calm), seed).observations
        single, seen = single_differences(flight), flight.observations
        inputs, present = link_inputs(flight, single)
        channel, rows = columns(flight, single), np.flatnonzero(present.sum(axis=(1, 2)) >= LEAST)
        rows = rows[:: len(rows) // EPOCHS]  # neighbours are alike
        error = {
            "code": (seen.code_m - clean.code_m)[:, :, channel],
            "phase": (seen.phase_cycles - clean.phase_cycles)[:, :, channel] * single.wavelength_m,
        }
        R_nb = truth_at(flight.truth, single.t_s).R_nb
        e_b = np.einsum("nmi,nij->nmj", np.nan_to_num(single.e_n), R_nb)
        arm_b_m = np.vstack([np.zeros(3), single.baselines_b_m])
        antenna, of = np.divmod(np.arange(present[0].size), len(channel))
        same = [x[:, None] == x for x in (of, antenna * len(channel) + single.group[of])]

        def flat(values: FloatArray) -> torch.Tensor:
            values = np.broadcast_to(values, present.shape + values.shape[3:])[rows]
            return torch.tensor(
                np.nan_to_num(values).reshape(len(values), len(of), *values.shape[3:])
            )

        sigma = {k: np.sqrt(getattr(single, f"{k}_variance_m2"))[:, None] for k in error}
        return cls(
            flat(inputs),
            flat(present),
            {k: flat(v) for k, v in error.items()},
            {k: flat(v) for k, v in sigma.items()},
            *(torch.tensor(one.astype(float)) for one in same),
            flat(-np.cross(arm_b_m[None, :, None], e_b[:, None])),
        )


class LinkNet(torch.nn.Module):
    """Logarithms of factors on standard deviations of code and phase; blind, constants."""

    def __init__(self, inputs: torch.Tensor, *, blind: bool = False) -> None:
        super().__init__()
        torch.manual_seed(SEED)
        self.mean, self.scale = inputs.mean(dim=0), float(not blind) / inputs.std(dim=0)
        sizes = (inputs.shape[1], WIDTH, WIDTH, 2)
        layers = [torch.nn.Linear(a, b) for a, b in pairwise(sizes)]
        torch.nn.init.zeros_(layers[-1].weight)
        torch.nn.init.zeros_(layers[-1].bias)
        self.layers = torch.nn.Sequential(
            layers[0], torch.nn.SiLU(), layers[1], torch.nn.SiLU(), layers[2]
        ).double()

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Return logarithms, (..., 2), of inputs, (..., f)."""
        return self.layers((inputs - self.mean) * self.scale)


def pooled_square(
    logarithm: torch.Tensor, present: torch.Tensor, of_channel: torch.Tensor
) -> torch.Tensor:
    """Return the mean square of factors over a channel's antennas, (k, q): the library has one."""
    square = ((2 * logarithm).exp() * present) @ of_channel
    return square / (present @ of_channel).clamp(min=1)


def loss_of(net: LinkNet, sample: Sample, through: float) -> torch.Tensor:
    """Return the negative log-likelihood of a link, clocks diffuse, and of the attitude's error."""
    present = sample.present.double()
    both, total = present[:, :, None] * present[:, None], 0.0
    for k, kind in enumerate(("code", "phase")):
        square = pooled_square(net(sample.inputs)[..., k], present, sample.of_channel)
        variance = torch.where(present > 0, square * sample.sigma_m[kind] ** 2, 1.0)
        mean = (variance * present).sum(1) / present.sum(1)
        C = DIFFUSE * mean[:, None, None] * both * (sample.of_channel + sample.of_antenna)
        L = torch.linalg.cholesky(C + torch.diag_embed(variance))
        whole = torch.cat([sample.error_m[kind][..., None], sample.design_m], dim=2)
        white = torch.linalg.solve_triangular(L, whole * present[..., None], upper=False)
        z, A = white[..., 0], white[..., 1:]
        log_det = 2 * L.diagonal(dim1=1, dim2=2).log().sum(1)
        total = total + (((z**2).sum(1) + log_det) / present.sum(1) / 2).mean()
    information = A.mT @ A + torch.eye(3) / PRIOR_RAD**2  # of phase, the last
    right = (A.mT @ z[..., None])[..., 0]
    nees = (right * torch.linalg.solve(information, right)).sum(1)
    return total + through * ((nees - torch.logdet(information)) / 2).mean()


def trained(samples: list[Sample], *, through: float, blind: bool = False) -> LinkNet:
    """Return a network that has learned from flights."""
    net = LinkNet(torch.cat([s.inputs[s.present] for s in samples]), blind=blind)
    optimiser = torch.optim.AdamW(net.parameters(), lr=4e-3, weight_decay=0.01)
    pace = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    rng = np.random.default_rng(SEED)
    for _ in range(STEPS):
        optimiser.zero_grad()
        for k in rng.choice(len(samples), FLIGHTS, replace=False):
            (loss_of(net, samples[k], through) / FLIGHTS).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        pace.step()
    return net

"""Recordings of the yardstick: what each is held against, and its figures."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import fgnav
from fgnav.checks import BoolArray, FloatArray
from fgnav.evaluation.span import within
from fgnav.geometry import rotations
from fgnav.geometry.interpolation import interpolate
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.methods.smoother import Batch
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Fixes
from tests import test_wettzell
from tests.benchmarks._rows import DATA
from tests.benchmarks._yardstick_results import judged, solved
from tests.recordings import drive as drive_of
from tests.recordings import quadrotor, uav

AIRBORNE_MPS = 8.0
UAV_S = (110.0, 400.0)  # a minute and a half on the ground, the rest in the air
MARGIN_S = 1.0  # of withheld fixes to the ends of the record: clocks disagree by half of it
FIRST_S, LAST_S, LENGTH_S, EVERY_S = 40.0, 30.0, 15.0, 45.0  # outages: README of the recording
AUTHORS_N_M = (0.155, 0.253, 0.089)  # RMS errors in outages, north, east, down: the same
ROUNDING_M = 0.011 / np.sqrt(12)  # of the recording's coordinates
SAME_S = 1e-6
INDEPENDENT = ("independent_gyro", "independent_nominal")


def _rms(values: FloatArray) -> list[float]:
    """Return the root mean square of each column."""
    return np.sqrt((values**2).mean(axis=0)).tolist()


def constants(estimate: Estimate) -> dict[str, float]:
    """Return the estimated constants that have one component, with their sigmas."""
    scalars = [one for one in estimate.calibration if np.size(one.value) == 1]
    sigmas = {f"{one.name} sigma": float(np.sqrt(one.covariance.item())) for one in scalars}
    return {one.name: one.value.item() for one in scalars} | sigmas


@dataclass(frozen=True, eq=False)
class Withheld:
    """An estimate's position errors at fixes it was not given, (m, 3), and their covariances."""

    e_n_m: FloatArray
    covariance_m2: FloatArray

    @classmethod
    def of(cls, estimate: Estimate, fixes: Fixes, withheld: BoolArray) -> "Withheld":
        """Return the errors at fixes whose antenna is the body's origin."""
        fixes = fixes[withheld]
        at = np.searchsorted(estimate.t_s, fixes.t_s - SAME_S).clip(max=len(estimate.t_s) - 1)
        there = np.abs(estimate.t_s[at] - fixes.t_s) < SAME_S
        at, fixes = at[there], fixes[there]
        noise_m2 = np.maximum(fixes.position_sigma_m, ROUNDING_M) ** 2
        return cls(
            e_n_m=estimate.p_n_m[at] - fixes.p_n_m,
            covariance_m2=estimate.position_covariance_m2[at] + noise_m2[:, :, None] * np.eye(3),
        )

    @property
    def nees(self) -> float:
        """Normalised errors squared, mean of all."""
        solved = np.linalg.solve(self.covariance_m2, self.e_n_m[..., None])[..., 0]
        return float((self.e_n_m * solved).sum(axis=1).mean())


def drive(*, outages: bool) -> dict:
    """Return the car against the fixes withheld: three of four, or 15 s of every 45.

    Its authors cut outages so; the errors of their own filter are figures beside.
    """
    whole = drive_of(DATA, stretched=True)
    fixes = whole.fixes[0]
    since_s = fixes.t_s - FIRST_S
    lost = (since_s >= 0) & (since_s % EVERY_S < LENGTH_S) & (fixes.t_s < fixes.t_s[-1] - LAST_S)
    withheld = lost if outages else np.round(fixes.t_s * 4).astype(int) % 4 != 0
    flight = replace(whole, fixes=(fixes[~withheld],))
    given_s = flight.fixes[0].t_s
    first_s = given_s[given_s > whole.imu.t_s[0]][0]  # no keyframe is before it
    t_s = fixes.t_s[(fixes.t_s >= first_s) & (fixes.t_s < whole.imu.t_s[-1])]

    def evaluate(estimate: Estimate) -> dict:
        errors = Withheld.of(estimate, fixes, withheld)
        rmse_m = float(np.sqrt((errors.e_n_m**2).sum(axis=1).mean()))
        peer = {"authors' filter": float(np.linalg.norm(AUTHORS_N_M))} if outages else {}
        found = {"rmse": {"position": rmse_m}, "nees": {"position": errors.nees}}
        return found | {"figures": peer | constants(estimate)}

    return solved(lambda: Batch().at(flight, t_s), evaluate)


def quadrotor_path(path: str) -> dict:
    """Return a quadrotor: attitude against its autopilot, and NEES of withheld positions.

    The inertial unit's mounting is not known: the mean rotation between the two is removed.
    """
    flight = quadrotor(DATA, path)
    file = DATA / "flights" / "quadrotor" / path / "GT.csv"
    table = np.genfromtxt(file, delimiter=",", skip_header=1)
    euler = np.unwrap(np.radians(table[:, [5, 4, 3]]), axis=0)
    t_s, imu_s = flight.fixes[0].t_s, flight.imu.t_s
    withheld = np.arange(len(t_s)) % 2 == 1
    half = replace(flight, fixes=(flight.fixes[0][~withheld],))
    inner = (t_s > imu_s[0] + MARGIN_S) & (t_s < min(imu_s[-1], t_s[-1]) - MARGIN_S)

    def attitude(estimate: Estimate) -> dict:
        inside = (estimate.t_s > table[0, 0]) & (estimate.t_s < table[-1, 0])
        theirs = rotations.from_euler(*interpolate(estimate.t_s[inside], table[:, 0], euler).T)
        turn = rotations.transpose(theirs) @ estimate.R_nb[inside]
        mean = rotations.nearest(turn.mean(axis=0, keepdims=True))
        error_deg = np.degrees(rotations.log(turn @ rotations.transpose(mean)))
        rms_deg = float(np.sqrt((error_deg**2).sum(axis=1).mean()))
        return {"rmse": {"attitude": rms_deg}, "figures": constants(estimate)}

    def position(estimate: Estimate) -> dict:
        return {"nees": {"position": Withheld.of(estimate, flight.fixes[0], withheld).nees}}

    more = solved(lambda: Batch().at(half, t_s[withheld & inner]), position)
    kept = {name: more[name] for name in ("nees", "failure") if name in more}
    return kept | solved(lambda: Batch()(flight), attitude)


def thor75() -> dict:
    """Return a UAV in the air against its on-board filter, which has the same measurements."""
    flight = within(uav(DATA), *UAV_S)

    def evaluate(estimate: Estimate) -> dict:
        airborne = np.linalg.norm(estimate.v_n_mps, axis=1) > AIRBORNE_MPS
        row = np.searchsorted(flight.truth.t_s, estimate.t_s).clip(max=len(flight.truth.t_s) - 1)
        ours, theirs = (rotations.to_euler(R) for R in (estimate.R_nb, flight.truth.R_nb[row]))
        rms_deg = np.degrees(_rms(rotations.wrap(ours - theirs)[airborne]))
        angles = dict(zip(("roll", "pitch", "yaw"), rms_deg, strict=True))
        return {"rmse": {"attitude": float(np.linalg.norm(rms_deg))}, "figures": angles}

    return solved(lambda: Batch()(flight), evaluate)


def independent(name: str, noise: str, *, wind_up: bool) -> dict:
    """Return a flight of another simulator, whose phases have no wind-up, against its truth."""
    flight = fgnav.load_flight(DATA / "flights" / name)
    flight = replace(flight, gnss_noise=replace(flight.gnss_noise, wind_up=wind_up))
    return judged(lambda: Batch(noise=noise)(flight), flight.truth)


def wettzell() -> dict:
    """Return two antennas of a station: share of epochs with right integers, and their angles."""
    places = {"wettzell": DATA / "wettzell", "orbits": DATA / "orbits"}
    text = test_wettzell.FLIGHT.format(**places, signals=test_wettzell.GPS)
    with TemporaryDirectory(prefix="fgnav-wettzell-") as folder:
        (Path(folder) / "flight.toml").write_text(text)
        flight = fgnav.load_flight(folder)

    def evaluate(estimate: Estimate) -> dict:
        right = test_wettzell.right_epochs(flight)
        at = np.isin(estimate.t_s, flight.observations.t_s[right])
        true_deg = [test_wettzell.ELEVATION_DEG, test_wettzell.HEADING_DEG]
        error = rotations.wrap(rotations.to_euler(estimate.R_nb[at])[:, 1:] - np.radians(true_deg))
        angles = dict(zip(("elevation", "heading"), np.degrees(_rms(error)), strict=True))
        return {"figures": {"share right": float(right.mean()), **angles}}

    return solved(lambda: MaximumLikelihood()(flight), evaluate)


RECORDINGS: dict[str, Callable[[], dict]] = {
    "wettzell": wettzell,
    **{
        f"{name}_{noise}": partial(independent, name=name, noise=noise, wind_up=False)
        for name in INDEPENDENT
        for noise in ("nominal", "estimated")
    },
    **{
        f"{name}_wind_up": partial(independent, name=name, noise="estimated", wind_up=True)
        for name in INDEPENDENT
    },
    "thor75": thor75,
    "quadrotor_path_10": partial(quadrotor_path, path="path_10"),
    "quadrotor_path_15": partial(quadrotor_path, path="path_15"),
    "drive_0708": partial(drive, outages=False),
    "drive_0708_outages": partial(drive, outages=True),
}

"""Recordings of the yardstick: what each is held against, and its figures."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import fgnav
from fgnav.checks import FloatArray
from fgnav.evaluation.span import within
from fgnav.geometry import rotations
from fgnav.geometry.interpolation import interpolate
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.methods.smoother import Batch
from fgnav.types.estimate import Estimate
from tests import test_wettzell
from tests.benchmarks import car
from tests.benchmarks._rows import DATA
from tests.benchmarks._yardstick_results import judged, solved
from tests.recordings import quadrotor, uav

AIRBORNE_MPS = 8.0
UAV_S = (110.0, 400.0)  # a minute and a half on the ground, the rest in the air
MARGIN_S = 1.0  # of withheld fixes to the ends of the record: clocks disagree by half of it
INDEPENDENT = ("independent_gyro", "independent_nominal")


def _rms(values: FloatArray) -> list[float]:
    """Return the root mean square of each column."""
    return np.sqrt((values**2).mean(axis=0)).tolist()


def constants(estimate: Estimate) -> dict[str, float]:
    """Return the estimated constants that have one component, with their sigmas."""
    scalars = [one for one in estimate.constants if np.size(one.value) == 1]
    sigmas = {f"{one.name} sigma": float(np.sqrt(one.covariance.item())) for one in scalars}
    return {one.name: one.value.item() for one in scalars} | sigmas


def drive() -> dict:
    """Return the car with a fix each second, against the fixes withheld between."""
    case = "withheld_batch"
    whole, given = car.flight_of(case)

    def evaluate(estimate: Estimate) -> dict:
        off = car.Off.of(estimate, whole.fixes[0], ~given)
        rmse_m = float(np.linalg.norm(off.rms_n_m))
        found = {"rmse": {"position": rmse_m}, "nees": {"position": off.nees}}
        return found | {"figures": constants(estimate)}

    return solved(lambda: car.solved(case, whole, given), evaluate)


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
        return {"nees": {"position": car.Off.of(estimate, flight.fixes[0], withheld).nees}}

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
        for noise in ("stated", "identified")
    },
    **{
        f"{name}_wind_up": partial(independent, name=name, noise="identified", wind_up=True)
        for name in INDEPENDENT
    },
    "thor75": thor75,
    "quadrotor_path_10": partial(quadrotor_path, path="path_10"),
    "quadrotor_path_15": partial(quadrotor_path, path="path_15"),
    "drive_0708": drive,
}

"""Fins that hold the nose in the air: the factor, and the heading that it alone determines."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.scores import errors_against
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.methods.closed_form import ClosedForm
from fgnav.methods.smoother import Batch, Smoother
from fgnav.types.vehicle import FinnedVehicle
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario, load_scenario
from fgnav_sim.simulate import simulate

SWING_DEG = 8.0  # the largest of a drawn amplitude: sigma is that of its sine, over all draws


def test_a_flight_keeps_its_fins_and_refuses_those_of_wheels(tmp_path):
    vehicle = FinnedVehicle(sideslip_sigma_rad=0.1, half_life_s=2.5, crossflow_sigma_mps=1.5)
    save_flight(replace(straight(0), vehicle=vehicle), tmp_path)
    again = load_flight(tmp_path).vehicle
    assert msgspec.to_builtins(again) == pytest.approx(msgspec.to_builtins(vehicle))
    text = (tmp_path / "flight.toml").read_text(encoding="utf-8")
    (tmp_path / "flight.toml").write_text(text.replace('kind = "finned"', 'kind = "wheeled"'))
    with pytest.raises(BadInputError, match='goes with kind = "finned"'):
        load_flight(tmp_path)


def straight(seed, duration_s=30.0):
    """Return a flight along a slope, one antenna, an accelerometer; the nose swings."""
    rng = np.random.default_rng([31, seed])
    speed_mps, slope_deg, course_deg = rng.uniform((30.0, 0.0, -180.0), (250.0, 60.0, 180.0))
    slope_rad = np.radians(slope_deg)

    def swing(middle_deg):
        return Sine(
            amplitude_deg=rng.uniform(0.0, SWING_DEG),
            rate_radps=rng.uniform(0.2, 3.0),
            phase_deg=rng.uniform(0.0, 360.0),
            offset_deg=float(middle_deg),
        )

    raw = GnssTable(rate_hz=10.0, signals={"G": ("1C",)}, code_noise_m=0.3, phase_noise_m=0.003)
    scenario = Scenario(
        duration_s=duration_s,
        motion=Motion(
            path=Straight(
                speed_mps=float(speed_mps * np.cos(slope_rad)),
                climb_mps=float(speed_mps * np.sin(slope_rad)),
                course_deg=float(course_deg),
            ),
            roll=swing(0.0),
            pitch=swing(slope_deg),
            yaw=swing(course_deg),
        ),
        antennas_b_m=((0.0, 0.0, 0.0),),
        gnss=raw if seed % 2 else None,
        fixes=None if seed % 2 else FixesTable(rate_hz=10.0),
        imu=ImuTable(),
    )
    return simulate(scenario, rng)


@pytest.mark.parametrize("method", [Batch(), Smoother()], ids=lambda m: m.name)
def test_fins_give_straight_flights_a_heading_and_its_sigma(method):
    sigma_rad = float(np.radians(SWING_DEG) / np.sqrt(6))
    fins = FinnedVehicle(sideslip_sigma_rad=sigma_rad, attack_sigma_rad=sigma_rad)
    nees, squared = [], np.zeros(2)
    for seed in range(4):
        flight = straight(seed)
        found = method(replace(flight, vehicle=fins))
        errors, rough = (errors_against(flight.truth, one) for one in (found, ClosedForm()(flight)))
        assert found.converged
        assert not found.unobservable
        squared += [(one.tangent_b_rad**2).mean() for one in (errors, rough)]
        nees.append(errors.nees.mean())
    assert squared[0] < squared[1]
    assert 1.0 < np.mean(nees) < 4.0


def test_without_fins_the_heading_of_a_straight_flight_is_said_to_be_open():
    for seed in range(2):
        assert "heading" in Batch(noise="nominal")(straight(seed, 8.0)).unobservable


@pytest.mark.parametrize("name", ["rocket", "glider"])
def test_fins_of_flown_bodies_are_stated_as_they_hold(name):
    """Angles to the air, over what their vehicle states: one in the mean square."""
    scenario = msgspec.structs.replace(load_scenario(name), gnss=None)
    flown = scenario.flown
    squares = []
    rngs = [np.random.default_rng([3, k]) for k in range(8)]
    for flight in (simulate(scenario, rng) for rng in rngs):
        truth, fins = flight.truth, flight.vehicle
        height_m = scenario.origin.height_m - truth.p_n_m[:, 2]
        air_n_mps = truth.v_n_mps.copy()
        for axis, column in enumerate((flown.wind.north_mps, flown.wind.east_mps)):
            wind = np.broadcast_to(column, len(flown.wind.height_m))
            air_n_mps[:, axis] -= np.interp(height_m, flown.wind.height_m, wind)
        u = np.einsum("nji,nj->ni", truth.R_nb, air_n_mps)
        angles = np.arctan2(u[:, 1:], u[:, :1])
        speed_mps = np.linalg.norm(air_n_mps, axis=1)[:, None]
        sigma = np.array([fins.sideslip_sigma_rad, fins.attack_sigma_rad])
        fast = 0.5 * speed_mps[:, 0] > np.hypot(fins.wind_sigma_mps, fins.crossflow_sigma_mps)
        normalised = angles / np.hypot(sigma, fins.crossflow_sigma_mps / speed_mps)
        squares.append((normalised[fast] ** 2).mean())
    assert 0.3 < np.mean(squares) < 2.0

"""A whole flight: repeatable, its sensors independent, and what estimators expect of it."""

import msgspec
import numpy as np
import pytest

from fgnav.gnss.difference import double_differences
from fgnav.gnss.single_point.solution import code_solution
from fgnav_sim.gnss.tables import BaselineTable, ClockTable, GnssTable
from fgnav_sim.motion import Arc, Motion, Sine
from fgnav_sim.scenario import (
    FixesTable,
    ImuTable,
    PhotodetectorTable,
    Place,
    Scenario,
    load_scenario,
)
from fgnav_sim.sensors.surroundings_tables import BarometerTable, MagnetometerTable
from fgnav_sim.simulate import simulate

SWING = Motion(path=Arc(), roll=Sine(amplitude_deg=20.0), pitch=Sine(amplitude_deg=20.0))
FULL = Scenario(
    name="full",
    duration_s=5.0,
    motion=SWING,
    gnss=GnssTable(elevation_weights="uniform", code_noise_m=0.3),
    imu=ImuTable(),
    fixes=FixesTable(antennas=("a1", "a4")),
    baseline=BaselineTable(antennas=("a5", "a4")),
    photodetector=PhotodetectorTable(landmark=Place(latitude_deg=40.34), field_of_view_deg=13.0),
    barometer=BarometerTable(),
    magnetometer=MagnetometerTable(),
)


SENSORS = {
    "gnss": lambda f: f.observations.phase_cycles,
    "imu": lambda f: f.imu.f_b_mps2,
    "fixes": lambda f: np.stack([one.p_n_m for one in f.fixes]),
    "baseline": lambda f: f.baselines[0].vector_n_m,
    "photodetector": lambda f: f.photodetector.currents,
    "barometer": lambda f: f.barometer.height_m,
    "magnetometer": lambda f: f.magnetometer.field_b_ut,
}


def made(scenario, seed=1):
    return simulate(scenario, np.random.default_rng(seed))


def without(name):
    return msgspec.structs.replace(FULL, **{name: None})


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


@pytest.mark.parametrize("name", [*SENSORS])
def test_a_sensor_that_is_left_out_changes_no_other(name):
    whole, part = made(FULL), made(without(name))
    for other, values in SENSORS.items():
        if other != name:
            assert same(values(whole), values(part))
    field = {"gnss": "observations", "baseline": "baselines"}.get(name, name)
    assert not getattr(part, field)


def test_truth_is_the_motion():
    flight = made(FULL)
    state = FULL.motion(flight.truth.t_s)
    assert same(flight.truth.p_n_m, state.p_n_m)
    assert same(flight.truth.v_n_mps, state.v_n_mps)
    assert same(flight.truth.R_nb, state.R_nb)
    assert same(flight.truth.t_s, flight.observations.t_s)


def test_the_flight_says_what_estimators_need_to_know():
    flight = made(FULL)
    assert [antenna.name for antenna in flight.antennas] == [f"a{k}" for k in range(1, 9)]
    assert flight.gnss_noise.code_m == 0.3
    assert flight.gnss_noise.elevation_weights == "uniform"
    assert np.degrees(flight.elevation_mask_rad) == pytest.approx(10.0)
    assert flight.imu.accelerometer_bias_mps2 == 0.03
    assert not flight.unused


def test_receivers_without_observations_bring_the_antennas_they_speak_of():
    flight = made(without("gnss"))
    assert [antenna.name for antenna in flight.antennas] == ["a1", "a4", "a5"]
    error_m = flight.fixes[0].p_n_m - FULL.motion(flight.fixes[0].t_s).p_n_m
    assert 0 < np.abs(error_m).max() < 5.0


def test_a_beacon_that_is_never_seen_is_counted():
    behind = PhotodetectorTable(landmark=Place(latitude_deg=40.32))
    flight = made(msgspec.structs.replace(FULL, photodetector=behind))
    assert flight.photodetector is None
    assert [loss.what for loss in flight.unused] == ["photodetector"]
    assert "never within range" in flight.unused[0].reason


@pytest.mark.parametrize("name", ["demo", "ramp", "spin", "approach"])
def test_double_differences_of_every_scenario_are_integers_within_the_noise(name):
    scenario = load_scenario(name)
    flight = made(msgspec.structs.replace(scenario, duration_s=12.0))
    differences = double_differences(flight)
    links = differences.resolvable
    assert links.sum(axis=(1, 2)).min() >= 7 * 5
    array_m = differences.array_m(flight.truth.R_nb)
    cycles = (differences.phase_m - array_m) / differences.wavelength_m
    fraction = (cycles - np.round(cycles))[links] * differences.wavelength_m[0]
    assert np.std(fraction) == pytest.approx(2 * 0.003, rel=0.1)  # four links of 3 mm
    code_m = (differences.code_m - array_m)[links]
    assert np.std(code_m) == pytest.approx(2 * 0.3, rel=0.1)
    assert (differences.reference == differences.reference[0]).all()
    integers = np.round(cycles)[:, links.all(axis=0)]
    assert (integers == integers[0]).all()


@pytest.mark.parametrize("name", ["rough", "six", "beacon", "coast", "tumble"])
def test_every_scenario_of_the_gallery_flies(name):
    flight = made(load_scenario(name))
    tracked = flight.observations.tracked.sum(axis=2)
    gaps = flight.observations.lock_flags.any()
    assert gaps == (name == "rough")
    assert (tracked[:, 0] == 6).all() == (name == "six")
    assert (flight.photodetector is not None) == (name == "beacon")
    assert [loss.what for loss in flight.unused] == ["photodetector sample"] * (name == "beacon")


@pytest.mark.parametrize("atmosphere", [True, False])
@pytest.mark.parametrize("clock_s", [1e-7, 1e-4])
def test_the_code_solution_finds_the_vehicle(atmosphere, clock_s):
    gnss = GnssTable(
        rate_hz=2.0,
        signals={"G": ("1C",), "E": ("1C",), "C": ("2I",)},
        code_noise_m=0.01,
        elevation_weights="uniform",
        atmosphere=atmosphere,
        clock=ClockTable(offset_s=clock_s),
    )
    flight = made(Scenario(duration_s=20.0, motion=SWING, gnss=gnss))
    solution = code_solution(flight)
    error_m = solution.p_n_m - flight.truth.p_n_m[::5][solution.epoch]
    assert len(solution.t_s) == 40
    assert np.sqrt(np.mean(np.sum(error_m**2, axis=1))) < 0.03
    error_mps = solution.v_n_mps - flight.truth.v_n_mps[::5][solution.epoch]
    assert np.sqrt(np.mean(np.sum(error_mps**2, axis=1))) < 0.15  # Doppler noise 0.05 m/s


def test_satellites_of_a_broadcast_file_fly_as_it_says(shared, tmp_path):
    path = tmp_path / "real.toml"
    path.write_text(
        f"""
        start = 2020-06-25T12:00:00
        duration_s = 10.0
        [motion]
        path = {{ kind = "arc" }}
        [gnss]
        navigation = ["{shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"}"]
        signals = {{ G = ["1C"], E = ["1C"], C = ["2I"] }}
        code_noise_m = 0.01
        elevation_weights = "uniform"
        """,
        encoding="utf-8",
    )
    flight = made(load_scenario(path))
    tracked = flight.observations.tracked[:, 0].sum(axis=1)
    assert tracked.min() >= 16  # as a receiver with three constellations over Madrid
    assert flight.broadcast.records["group_delay_s"].any()
    assert flight.broadcast.klobuchar.any()
    solution = code_solution(flight)
    error_m = solution.p_n_m - flight.truth.p_n_m[solution.epoch]
    assert len(solution.t_s) == 100
    assert np.sqrt(np.mean(np.sum(error_m**2, axis=1))) < 0.03
    differences = double_differences(flight)
    cycles = (
        differences.phase_m - differences.array_m(flight.truth.R_nb)
    ) / differences.wavelength_m
    fraction = (cycles - np.round(cycles)) * differences.wavelength_m
    assert np.std(fraction[differences.resolvable]) == pytest.approx(2 * 0.003, rel=0.1)


def test_orbits_of_a_file_flown_in_vacuum_carry_no_ionosphere(shared):
    file = shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"
    gnss = GnssTable(navigation=(str(file),), atmosphere=False)
    flight = made(Scenario(duration_s=1.0, gnss=gnss))
    assert not flight.broadcast.klobuchar.any()


def test_misplaced_antennas_are_stated_where_they_are_not():
    whole, moved = made(FULL), made(msgspec.structs.replace(FULL, antenna_misplacement_m=0.05))
    for a, b in zip(whole.antennas, moved.antennas, strict=True):
        assert same(a.position_b_m, b.position_b_m)
    apart_m = moved.observations.code_m - whole.observations.code_m
    # Noise is the same: what differs is each antenna's own few centimetres, by satellite.
    assert 0.01 < np.nanstd(apart_m) < 0.15
    of_antenna_m = apart_m - apart_m[:, :1]
    assert (np.nanstd(of_antenna_m[:, 1:], axis=(0, 2)) > 0.005).all()
    assert same(whole.imu.f_b_mps2, moved.imu.f_b_mps2)
    assert not same(whole.fixes[0].p_n_m, moved.fixes[0].p_n_m)  # of the first, which moved, too

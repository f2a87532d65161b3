"""Satellites that fly by SP3 tables: the truth is the table, the messages err as they are."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.gnss.single_point.solution import code_solution
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

TABLE = "COD0MGXFIN_20201770000_01D_05M_ORB.SP3"
MESSAGES = "ESBC00DNK_R_20201770000_01D_MN.rnx"


@pytest.fixture
def made(shared, tmp_path):
    def make(*, messages=True, atmosphere=True, choose='"all"'):
        path = tmp_path / "precise.toml"
        navigation = f'["{shared / "orbits" / MESSAGES}"]' if messages else "[]"
        path.write_text(
            f"""
            start = 2020-06-25T12:00:00
            duration_s = 10.0
            antennas_b_m = [[0, 0, 0], [1, 0, 0]]
            [motion]
            path = {{ kind = "arc" }}
            [gnss]
            rate_hz = 2.0
            orbits = ["{shared / "orbits" / TABLE}"]
            navigation = {navigation}
            choose = {choose}
            signals = {{ G = ["1C"], E = ["1C"] }}
            code_noise_m = 0.01
            elevation_weights = "uniform"
            atmosphere = {str(atmosphere).lower()}
            """,
            encoding="utf-8",
        )
        return simulate(load_scenario(path), np.random.default_rng(1))

    return make


def errors_m(flight):
    solution = code_solution(flight)
    assert len(solution.t_s) == 20
    return solution.p_n_m - flight.truth.p_n_m[::5][solution.epoch]


def test_by_the_table_the_vehicle_is_found_and_by_the_messages_nearly(made):
    flight = made()
    assert flight.precise is not None
    assert flight.broadcast is not None
    assert np.linalg.norm(errors_m(flight), axis=1).max() < 0.1
    by_messages = replace(flight, precise=None)
    error_m = np.linalg.norm(errors_m(by_messages), axis=1)
    assert 0.2 < error_m.mean() < 4.0  # orbits, clocks and phase centres of the messages


@pytest.mark.parametrize("atmosphere", [True, False])
def test_without_messages_there_is_no_ionosphere_and_no_group_delay(made, tmp_path, atmosphere):
    flight = made(messages=False, atmosphere=atmosphere)
    assert flight.broadcast is None
    assert np.linalg.norm(errors_m(flight), axis=1).max() < 0.1
    save_flight(flight, tmp_path / "flight")
    back = load_flight(tmp_path / "flight")
    assert back.precise.satellites == flight.precise.satellites
    assert np.linalg.norm(errors_m(replace(back, truth=flight.truth)), axis=1).max() < 0.1


def test_six_of_the_table_are_chosen(made):
    seen = made(choose=6).observations
    assert (seen.tracked.sum(axis=2) == 6).all()

"""Baselines, gravity and line of sight stacked: exact, of honest covariance, one of them gone."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.attitude.baselines import paper_baselines
from fgnav.attitude.flight_vectors import measured_vectors, track_of
from fgnav.checks import BadInputError
from fgnav.evaluation.ablation import restricted
from fgnav.geometry import rotations
from fgnav.gnss.difference import double_differences
from fgnav.gravity import LowDynamics
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.closed_form import ClosedForm, weighted
from fgnav.neural.factor import NeuralFactor
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Motion, Sine, Straight
from fgnav_sim.scenario import ImuTable, PhotodetectorTable, Place, Scenario
from fgnav_sim.simulate import simulate
from tests.methods.true_gravity import TrueGravity
from tests.neural import graphs

LIVELY = Motion(
    path=Straight(speed_mps=100.0, climb_mps=-12.0),
    roll=Sine(amplitude_deg=20.0),
    pitch=Sine(amplitude_deg=5.0),
    yaw=Sine(amplitude_deg=5.0),
)
# 30 km ahead: an error of position counts for nothing, whatever part of it the flight states.
BEACON = PhotodetectorTable(landmark=Place(latitude_deg=40.6, height_m=300.0), range_m=50e3)
KINDS = ("baseline", "gravity", "line of sight")
METHODS = {"equal": ClosedForm, "weighted": weighted}


def flown(seed, *, scale=1.0):
    """Return a flight with array, accelerometer and photodetector, its noise so many times."""
    gnss = GnssTable(
        rate_hz=10.0,
        code_noise_m=0.3 * scale,
        phase_noise_m=0.003 * scale,
        elevation_weights="uniform",
        atmosphere=scale == 1.0,
    )
    photodetector = msgspec.structs.replace(BEACON, line_of_sight_noise_rad=1e-3 * scale)
    made = Scenario(
        duration_s=6.0, motion=LIVELY, gnss=gnss, imu=ImuTable(), photodetector=photodetector
    )
    return simulate(made, np.random.default_rng(seed))


class NoIntegers(Truth):
    """No integer at all: an array that lacks."""

    def __call__(self, differences, flight):
        whole = super().__call__(differences, flight)
        none = np.zeros_like(whole.fixed)
        return replace(whole, cycles=np.zeros_like(whole.cycles), fixed=none)


def closed_form(how, missing, gravity):
    """Return the method without one kind of pair, and what of the flight goes with it."""
    resolver = NoIntegers() if missing == "baseline" else Truth()
    gravity = None if missing == "gravity" else gravity
    method = METHODS[how](resolver=resolver, gravity=gravity)
    left_out = ("line-of-sight",) if missing == "line of sight" else ()
    return restricted(how, method, left_out)


def errors_rad(flight, estimate):
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    return rotations.log(estimate.R_nb.swapaxes(1, 2) @ flight.truth.R_nb[row])


@pytest.mark.parametrize("missing", ["", *KINDS])
@pytest.mark.parametrize("how", METHODS)
def test_without_noise_any_two_kinds_restore_the_attitude(how, missing):
    flight = flown(1, scale=1e-4)
    estimate = closed_form(how, missing, TrueGravity(sigma_deg=0.001))(flight)
    rmse_deg = np.degrees(np.sqrt((errors_rad(flight, estimate) ** 2).mean(axis=0)))
    assert (rmse_deg < 0.01).all()
    (note,) = [note for note in estimate.notes if note.startswith("Pairs: ")]
    assert [kind in note for kind in KINDS] == [kind != missing for kind in KINDS]


@pytest.mark.parametrize("missing", ["", *KINDS])
@pytest.mark.parametrize("how", METHODS)
def test_errors_meet_the_stated_covariance(how, missing):
    nees = []
    for seed in range(8):
        flight = flown(seed)
        estimate = closed_form(how, missing, TrueGravity(sigma_deg=1.0, seed=seed))(flight)
        error = errors_rad(flight, estimate)
        P = estimate.attitude_covariance_rad2
        nees.append(np.einsum("ni,ni->n", error, np.linalg.solve(P, error[..., None])[..., 0]))
    assert 2.0 < np.concatenate(nees).mean() < 4.0


def test_all_pairs_weighted_beat_equal_weights_and_baselines_alone():
    def rmse_deg(how, missing):
        flights = [flown(seed) for seed in range(4)]
        gravity = TrueGravity(sigma_deg=1.0)
        errors = [errors_rad(one, closed_form(how, missing, gravity)(one)) for one in flights]
        return np.degrees(np.sqrt((np.concatenate(errors) ** 2).mean()))

    whole = rmse_deg("weighted", "")
    assert all(whole < rmse_deg("weighted", kind) for kind in KINDS)
    assert whole < rmse_deg("equal", "")


def test_equal_weights_are_equation_20_solved_directly():
    flight = flown(3)
    estimate = ClosedForm(resolver=Truth())(flight)
    differences = double_differences(flight)
    b_n_m = paper_baselines(differences, Truth()(differences, flight)).b_n_m
    track = track_of(flight)
    seen, _ = measured_vectors(flight, track)
    assert seen.sources == ("specific force", "line of sight")
    for k in (5, 20):  # of the epochs that have every pair
        v_n = np.concatenate([b_n_m[k], seen.v_n[k]])
        v_b = np.concatenate([differences.baselines_b_m, seen.v_b[k]])
        N_n, N_b = (v.T / np.linalg.norm(v, axis=1) for v in (v_n, v_b))
        T = N_n @ N_b.T @ np.linalg.inv(N_b @ N_b.T)
        np.testing.assert_allclose(
            rotations.to_euler(estimate.R_nb[k][None]), rotations.to_euler(T[None]), atol=1e-9
        )


def test_an_epoch_takes_gravity_once_and_specific_force_only_where_it_has_none():
    flight = flown(2)
    every_third = ClosedForm(resolver=Truth(), gravity=TrueGravity(every=3))(flight)
    assert "20 of gravity" in every_third.notes[0]
    assert "39 of specific force" in every_third.notes[0]  # 58 have both neighbours, 19 gravity
    by_low_dynamics = ClosedForm(resolver=Truth(), gravity=LowDynamics())(flight)
    assert any(loss.what.startswith("gravity window") for loss in by_low_dynamics.unused)


def test_a_network_of_gravity_makes_pairs_and_others_none(tmp_path):
    flight = simulate(
        Scenario(duration_s=6.0, motion=Motion(path=Straight()), gnss=GnssTable(), imu=ImuTable()),
        np.random.default_rng(5),
    )
    down = {"measures": "direction", "sensor": "accelerometer", "value": [0.0, 0.0, 1.0]}
    down |= {"spread": -7.0}  # .05 degrees
    network = NeuralFactor(graphs.heading(tmp_path, **down))
    seen = weighted(resolver=Truth(), factors=(network,))(flight)
    assert " of gravity" in seen.notes[0]
    assert np.degrees(np.abs(errors_rad(flight, seen)[10:, :2])).max() < 0.1
    without = restricted("less", ClosedForm(resolver=Truth(), factors=(network,)), ("gravity",))
    assert without(flight).notes[0] == "Pairs: 420 of baseline."


def test_a_method_without_gravity_cannot_go_without_it():
    none = ClosedForm(resolver=Truth(), gravity=None, factors=())
    with pytest.raises(BadInputError, match="without gravity: closed-form has none"):
        restricted("less", none, ("gravity",))

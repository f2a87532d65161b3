"""The truncation test: what is due before a cut is the same in a flight that is cut."""

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.assembly.truncation import truncated
from fgnav.attitude.array import AttitudeSolution
from fgnav.attitude.flight_vectors import measured_vectors, track_of
from fgnav.checks import BadInputError
from fgnav.geometry.rotations import log, transpose
from fgnav.gnss.difference import double_differences
from fgnav.gnss.intervals import usual_interval_so_far_s
from fgnav.gnss.single_differences import motion_so_far, single_differences
from fgnav.gnss.single_point.solution import code_solution
from fgnav.gravity import LowDynamics, causal_gravity, gravity_named
from fgnav.integers.acceptance import share_so_far, share_threshold
from fgnav.integers.resolvers.causal import causal_form, looks_ahead
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.integers.resolvers.resolve import resolve
from fgnav.integers.resolvers.rounding import Rounding
from fgnav.integers.resolvers.truth import Truth
from fgnav.integers.validation import validated
from fgnav.photodetector import line_of_sight
from fgnav.types.flight import Flight, Imu
from fgnav_sim.gnss.tables import OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.methods.simulated import SCENARIOS

FALSE_ALARM = 1e-4
REFERENCE_GONE = OutageTable(from_s=3.0, until_s=6.0, antennas=("a1",))
LATE = OutageTable(from_s=0.0, until_s=7.0, azimuth_deg=(0.0, 60.0))
FLIGHTS = {
    "demo": ("demo", 12.0, {}),
    "no atmosphere": ("demo", 8.0, {"atmosphere": False}),
    "two carriers": ("demo", 6.0, {"signals": {"G": ("1C", "5Q"), "E": ("5Q", "1C")}}),
    "reference antenna gone": ("demo", 10.0, {"outages": (REFERENCE_GONE,)}),
    "satellites that rise": ("demo", 10.0, {"outages": (LATE,)}),
    "rough": ("rough", 24.0, {}),
    "message errors": ("demo", 8.0, {"message_errors": True}),
}


@cache
def flown(which):
    name, span_s, changes = FLIGHTS[which]
    scenario = load_scenario(SCENARIOS / f"{name}.toml")
    gnss = msgspec.structs.replace(scenario.gnss, **changes)
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss)
    return simulate(scenario, np.random.default_rng(20_001))


@cache
def approach():
    """Return the approach to a beacon that saturates the detector, its array left out."""
    scenario = load_scenario(SCENARIOS / "beacon.toml")
    scenario = msgspec.structs.replace(scenario, antennas_b_m=((0.0, 0.0, 0.0),))
    return simulate(scenario, np.random.default_rng(20_002))


def cuts(flight):
    t_s = flight.observations.t_s
    return [float(t_s[int(share * (len(t_s) - 1))]) + 0.03 for share in (0.2, 0.55, 0.9)]


def causal_track(flight):
    return code_solution(flight, causal=True)


def causal_array(flight, resolver):
    """Differences of the array, what a resolver makes of them, and what agrees of that."""
    differences, resolved = resolve(flight, resolver, causal=True)
    names = tuple(antenna.name for antenna in flight.antennas)
    return differences, resolved, validated(differences, resolved, names, FALSE_ALARM, causal=True)


@cache
def whole_array(which, resolver):
    return causal_array(flown(which), resolver)


def assert_same(found, expected):
    assert_array_equal(np.isnan(found), np.isnan(expected))
    assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


def columns(part, whole):
    """Return the channels of the whole that a part has, in its order."""
    names = list(zip(whole.satellites, whole.signals, strict=True))
    return [names.index(pair) for pair in zip(part.satellites, part.signals, strict=True)]


@pytest.mark.parametrize("which", FLIGHTS)
def test_track_before_a_cut_is_the_same(which):
    flight = flown(which)
    whole = causal_track(flight)
    for cut_s in cuts(flight):
        part = causal_track(truncated(flight, cut_s))
        assert_array_equal(part.t_s, whole.t_s[whole.t_s <= cut_s])
        n = len(part.t_s)
        assert_allclose(part.p_n_m, whole.p_n_m[:n], rtol=0, atol=1e-9)
        for name in (
            "position_covariance_m2",
            "position_noise_m2",
            "v_n_mps",
            "velocity_covariance_m2ps2",
            "clock_drift_sps",
        ):
            assert_same(getattr(part, name), getattr(whole, name)[:n])
        clocks = [whole.constellations.index(letter) for letter in part.constellations]
        assert_same(part.clock_s, whole.clock_s[:n, clocks])
        of = [whole.satellites.index(satellite) for satellite in part.satellites]
        assert_array_equal(part.used, whole.used[:n, of])


@pytest.mark.parametrize("which", FLIGHTS)
@pytest.mark.parametrize("resolver", [Constrained(), Lambda()], ids=["constrained", "lambda"])
def test_array_before_a_cut_is_the_same(which, resolver):
    flight = flown(which)
    differences, _, whole = whole_array(which, resolver)
    assert whole.attitude.solved.mean() > 0.5
    for cut_s in cuts(flight):
        of_part, _, part = causal_array(truncated(flight, cut_s), resolver)
        n, of = len(of_part.t_s), columns(of_part, differences)
        assert n == (differences.t_s <= cut_s).sum()
        _assert_same_differences(of_part, differences, n, of)
        for name in ("cycles", "fixed"):
            expected = getattr(whole.integers, name)[:n][:, :, of]
            assert_array_equal(getattr(part.integers, name), expected)
        assert_array_equal(part.excluded, whole.excluded[:n][:, :, of])
        assert_array_equal(part.refused, whole.refused[:n])
        assert_array_equal(part.attitude.solved, whole.attitude.solved[:n])
        assert_same(part.attitude.R_nb, whole.attitude.R_nb[:n])
        scale = np.abs(whole.form.information[:n]).max()
        assert_allclose(part.form.information, whole.form.information[:n], atol=1e-12 * scale)
        variance = np.abs(whole.attitude.covariance_rad2[:n]).max(axis=(1, 2), keepdims=True)
        relative = (part.attitude.covariance_rad2 - whole.attitude.covariance_rad2[:n]) / variance
        assert np.abs(relative).max() < 1e-9  # an inverse of what is nearly singular


def _assert_same_differences(part, whole, n, of):
    for name in ("code_m", "phase_m", "arc"):
        expected = getattr(whole, name)[:n][:, :, of]
        assert_allclose(getattr(part, name), expected, rtol=0, atol=1e-9)
    for name in ("e_n", "code_variance_m2", "phase_variance_m2"):
        assert_same(getattr(part, name), getattr(whole, name)[:n][:, of])


@pytest.mark.parametrize("which", FLIGHTS)
def test_causal_array_is_as_good_as_one_that_looks_ahead(which):
    flight = flown(which)
    differences, _, found = whole_array(which, Constrained())
    truth = flight.truth
    row = np.searchsorted(truth.t_s, differences.t_s - 1e-6)
    delta = log(transpose(truth.R_nb[row]) @ found.attitude.R_nb)
    good = found.attitude.solved & ~found.refused
    assert good.mean() > (0.6 if which == "reference antenna gone" else 0.9)
    P = found.attitude.covariance_rad2
    nees = np.einsum("ni,nij,nj->n", delta, np.linalg.inv(P), delta)[good]
    assert nees.mean() < 6.0  # of 3; rough skies are louder than stated


def test_reference_antenna_is_carried_on_for_half_a_minute():
    flight = flown("reference antenna gone")
    t_s = flight.observations.t_s
    p_e_m, _ = motion_so_far(flight, t_s)
    assert np.isfinite(p_e_m).all()
    row = np.searchsorted(flight.truth.t_s, t_s - 1e-6)
    p_n_m = (p_e_m - flight.origin.p_e_m) @ flight.origin.R_ne.T
    gone = (t_s > 3.05) & (t_s < 5.95)
    off_m = np.linalg.norm((p_n_m - flight.truth.p_n_m[row])[gone], axis=1)
    assert off_m.max() < 100.0  # 3 s of a turn of 100 m/s: next to nothing for directions
    far_s = t_s[-1] + np.array([29.0, 31.0])
    assert_array_equal(np.isfinite(motion_so_far(flight, far_s)[0]).all(axis=1), [True, False])


def test_usual_interval_is_that_of_intervals_before():
    t_s = np.array([0.0, 1.0, 2.0, 3.0, 13.0, 23.0, 33.0, 43.0, 53.0])
    expected = [np.inf, np.inf, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 10.0]
    assert_array_equal(usual_interval_so_far_s(t_s), expected)


def test_noise_twice_as_loud_is_believed_after_some_epochs():
    rng = np.random.default_rng(4)
    n, freedom = 200, 20
    solution = AttitudeSolution(
        R_nb=np.tile(np.eye(3), (n, 1, 1)),
        covariance_rad2=np.tile(np.eye(3), (n, 1, 1)),
        chi_square=4.0 * rng.chisquare(freedom, n),
        degrees_of_freedom=np.full(n, freedom),
        solved=np.ones(n, dtype=bool),
        open_axis_b=np.zeros((n, 3)),
    )
    factor = solution.variance_factor_so_far()
    assert_array_equal(factor[:12], 1.0)  # 13 epochs have 253 degrees of freedom or more
    assert_allclose(factor[13:], 4.0, rtol=0.35)
    assert factor[-1] == pytest.approx(solution.variance_factor(), rel=0.1)


def test_velocity_without_doppler_is_that_of_positions_before():
    flight = flown("demo")
    silent = np.full_like(flight.observations.doppler_hz, np.nan)
    flight = replace(flight, observations=replace(flight.observations, doppler_hz=silent))
    _, v_e_mps = motion_so_far(flight, flight.observations.t_s)
    v_n_mps = v_e_mps @ flight.origin.R_ne.T
    row = np.searchsorted(flight.truth.t_s, flight.observations.t_s - 1e-6)
    assert_array_equal(v_n_mps[0], 0.0)
    off = np.linalg.norm(v_n_mps - flight.truth.v_n_mps[row], axis=1)[15:]
    assert off.mean() < 15.0  # a turn of 12 m/s2 over half a second, and noise of code over one


def test_vectors_of_an_approach_before_a_cut_are_the_same():
    flight = approach()
    track = track_of(flight, causal=True)
    whole, _ = measured_vectors(flight, track, causal=True)
    assert np.isfinite(whole.v_b).any(axis=(0, 2)).all()
    for cut_s in (30.03, 48.0, 57.03):
        cut = truncated(flight, cut_s)
        part, _ = measured_vectors(cut, track_of(cut, causal=True), causal=True)
        n = len(part.v_n)
        assert n == (track.t_s <= cut_s).sum()
        assert_array_equal(np.isnan(part.v_b), np.isnan(whole.v_b[:n]))
        assert_allclose(part.v_b, whole.v_b[:n], rtol=1e-12, atol=1e-9)
        assert_allclose(part.v_n, whole.v_n[:n], rtol=1e-12, atol=1e-9)


def test_line_of_sight_before_a_cut_is_the_same():
    photodetector = approach().photodetector
    whole = line_of_sight(photodetector, causal=True)
    for cut_s in (45.0, 55.0, 58.5):
        part = line_of_sight(truncated(approach(), cut_s).photodetector, causal=True)
        assert_array_equal(part.t_s, whole.t_s[whole.t_s <= cut_s])
        assert_array_equal(part.e_b, whole.e_b[: len(part.t_s)])


def test_limit_of_a_detector_shows_at_the_third_time():
    photodetector = approach().photodetector
    currents = np.tile([1.0, 2.0, 3.0, 4.0], (8, 1)) + 0.01 * np.arange(8)[:, None]
    currents[3:, 3] = 9.0
    t_s = np.arange(8.0)
    found = line_of_sight(replace(photodetector, t_s=t_s, currents=currents), causal=True)
    assert found.unused[0].reason == "a current stands at its limit"
    assert_array_equal(np.setdiff1d(t_s, found.t_s), [5.0, 6.0, 7.0])


@pytest.mark.parametrize("which", ["demo", "rough"])
def test_gravity_before_a_cut_is_the_same(which):
    flight = steady(flown(which))
    estimator = causal_gravity(gravity_named("low-dynamics"))
    assert not estimator.looks_ahead
    whole = estimator(flight)
    assert len(whole.t_s) > 4
    for cut_s in (2.0, 3.5004, 5.77):
        part = estimator(truncated(flight, cut_s))
        n = (whole.t_s <= cut_s).sum()
        assert_array_equal(part.t_s, whole.t_s[:n])
        assert_array_equal(part.g_b, whole.g_b[:n])
        assert_array_equal(part.covariance, whole.covariance[:n])


def steady(flight: Flight) -> Flight:
    """Return a flight whose accelerometer feels gravity as the body turns by 5 degrees a second."""
    imu: Imu = flight.imu
    roll = np.radians(5.0) * imu.t_s
    g_mps2 = np.linalg.norm(flight.origin.gravity_n_mps2(np.zeros((2, 3)))[0])
    f_b = -g_mps2 * np.stack([0 * roll, np.sin(roll), np.cos(roll)], axis=1)
    return replace(flight, imu=replace(imu, f_b_mps2=f_b))


def test_gravity_of_the_past_is_as_sure_as_a_turning_body_allows():
    flight = steady(flown("demo"))
    found = LowDynamics(causal=True)(flight)
    roll = np.radians(5.0) * found.t_s
    off_rad = np.abs(np.arctan2(found.g_b[:, 1], found.g_b[:, 2]) - roll)
    assert off_rad.max() < np.sqrt(
        found.covariance[:, 1, 1].max() + found.covariance[:, 2, 2].max()
    )
    assert found.t_s[0] == pytest.approx(flight.imu.t_s[0] + 0.5, abs=0.011)


def test_single_differences_of_the_past_are_those_of_the_whole_flight():
    flight = flown("demo")
    ahead, past = single_differences(flight), single_differences(flight, causal=True)
    assert past.satellites == ahead.satellites
    assert_allclose(past.e_n, ahead.e_n, atol=1e-8)  # 0.2 m of 20,000 km
    assert_allclose(past.phase_m, ahead.phase_m, atol=1e-6)


@pytest.mark.parametrize("resolver", [Rounding(), Lambda(), Truth()])
def test_resolvers_of_single_epochs_are_their_own_causal_form(resolver):
    assert not looks_ahead(resolver)
    assert causal_form(resolver) is resolver


def test_constrained_looks_ahead_unless_it_need_not():
    assert Constrained().looks_ahead
    assert not Constrained(causal=True).looks_ahead
    assert not Constrained(estimate_noise=False, wrong_max=None).looks_ahead
    assert causal_form(Constrained(wrong_max=1e-3)) == Constrained(wrong_max=1e-3, causal=True)


def test_resolver_that_states_nothing_is_asked_epoch_by_epoch():
    class Counting:
        """The integers of single epochs, and how many it saw at once."""

        name = "counting"

        def __init__(self):
            self.seen = []

        def __call__(self, differences, flight):
            self.seen.append(len(differences.t_s))
            return Lambda()(differences, flight)

    resolver = Counting()
    assert looks_ahead(resolver)
    flight = truncated(flown("demo"), 3.0)
    differences = double_differences(flight, causal=True)
    alone = causal_form(resolver)(differences, flight)
    together = Lambda()(differences, flight)
    assert set(resolver.seen) == {1}
    assert_array_equal(alone.cycles, together.cycles)
    assert_array_equal(alone.fixed, together.fixed)


@pytest.mark.parametrize("name", ["lambda-arcs", "constrained-arcs"])
def test_arcs_carry_integers_of_the_surest_epoch_so_far(name):
    resolver = resolver_named(name)
    assert looks_ahead(resolver)
    assert not looks_ahead(causal_form(resolver))
    flight = flown("rough")
    differences, whole = resolve(flight, resolver, causal=True)
    true = Truth()(differences, flight)
    both = whole.fixed & true.fixed
    assert both.mean() > 0.9 * true.fixed.mean()
    assert (whole.cycles == true.cycles)[both].mean() > 0.999
    of_part, part = resolve(truncated(flight, 11.03), resolver, causal=True)
    n, of = len(of_part.t_s), columns(of_part, differences)
    assert_array_equal(part.cycles, whole.cycles[:n][:, :, of])
    assert_array_equal(part.fixed, whole.fixed[:n][:, :, of])


def test_arcs_prepared_by_who_knows_what_have_no_causal_form():
    resolver = replace(resolver_named("lambda-arcs"), prepare=lambda differences: differences)
    with pytest.raises(BadInputError, match=r"'prepare' .* take 'constrained' or 'lambda'"):
        causal_form(resolver)


def test_gravity_that_states_nothing_is_taken_to_look_ahead():
    class Silent:
        name = "silent"

        def __call__(self, flight):  # noqa: ARG002  # as the Protocol has it
            pytest.fail("it must not be asked")

    with pytest.raises(BadInputError, match=r"gravity 'silent': .* take 'low-dynamics'"):
        causal_gravity(Silent())


def test_share_so_far_is_what_the_threshold_of_the_epochs_so_far_accepts():
    wrong = np.random.default_rng(3).uniform(0.0, 1.0, 60) ** 8
    found = share_so_far(wrong, 1e-2)
    for k in range(len(wrong)):
        so_far = wrong[: k + 1]
        assert found[k] == (so_far[k] <= -share_threshold(-so_far, so_far, 1e-2))


def test_cut_flight_keeps_what_came_before():
    flight = flown("satellites that rise")
    cut = truncated(flight, 4.0)
    assert cut.observations.t_s[-1] == pytest.approx(4.0)
    assert cut.imu.t_s[-1] == pytest.approx(4.0)
    assert len(cut.observations.satellites) < len(flight.observations.satellites)
    assert np.isfinite(cut.observations.code_m).any(axis=(0, 1)).all()
    assert cut.truth is flight.truth
    assert truncated(flight, -1.0).observations is None
    assert (
        truncated(approach(), 50.0).photodetector.t_s[-1] <= 50.0 < approach().photodetector.t_s[-1]
    )
    assert truncated(approach(), 1.0).photodetector is None

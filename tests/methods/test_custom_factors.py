"""Custom factors, as who writes one meets them: what they gain, and what goes wrong."""

import dataclasses
from functools import cache
from importlib.metadata import EntryPoint

import gtsam
import numpy as np
import pytest
from scipy.special import chdtri

from fgnav import cli, plugins
from fgnav.checks import BadInputError
from fgnav.geometry.rotations import log, transpose
from fgnav.graph import (
    angular_motion,
    constant,
    imu_bias,
    pose,
    residual_factor,
    velocity,
)
from fgnav.io.flight.folder import save_flight
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.methods.smoothing.concatenation import concatenate_estimates
from fgnav.methods.stream import Measured, Measurements, Stream, StreamConfig
from tests.assembly import flights
from tests.methods.simulated import errors_rad, flown, shared
from tests.methods.star_tracker import EVERY, NAME, SIGMA_RAD, StarTracker, drawn, own

METHODS = [Smoother(lag_s=2.0, noise="nominal"), Forward(noise="nominal"), Batch(noise="nominal")]
SEEDS = (20_001, 20_002, 20_003)
SPAN_S = 10.0
ODDS = 1e-3  # of a chi-square outside its band


@cache
def estimated(method, seed, native=None):
    """Return what a method makes of a flight, with a star tracker unless native is None."""
    flight = flown("demo", SPAN_S, seed)
    factors = () if native is None else (StarTracker(seed=seed, native=native),)
    return shared(dataclasses.replace(method, factors=factors), flight)


def rms(error):
    return np.sqrt((error**2).sum(axis=1).mean())


def squares(error, covariance):
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)


def assert_chi_square(total, freedom):
    assert chdtri(freedom, 1 - ODDS / 2) < total < chdtri(freedom, ODDS / 2)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_star_tracker_sharpens_the_attitude_and_states_how_much(method):
    nees, freedom = 0.0, 0
    for seed in SEEDS:
        flight = flown("demo", SPAN_S, seed)
        without, found = (estimated(method, seed, native) for native in (None, False))
        assert found.converged
        before, after = (errors_rad(flight, estimate) for estimate in (without, found))
        assert rms(after) < 0.95 * rms(before)
        # Of three axes at 30 arc seconds, 52; phase and motion sharpen that a little.
        assert rms(after[::EVERY]) < 1.2 * np.sqrt(3) * SIGMA_RAD < 0.4 * rms(before[::EVERY])
        # Ten keyframes apart the star tracker's noise is most of the error: as good as independent.
        nees += squares(after, found.attitude_covariance_rad2)[::EVERY].sum()
        freedom += 3 * len(after[::EVERY])
        assert 1 < squares(after, found.attitude_covariance_rad2).mean() < 4.5
    assert_chi_square(nees, freedom)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_innovations_of_a_star_tracker_are_reported_under_its_name(method):
    tests = [
        test
        for seed in SEEDS
        for test in estimated(method, seed, native=False).consistency
        if test.what == NAME
    ]
    assert [test.count for test in tests] == 3 * [SPAN_S * 10 // EVERY]
    freedom = sum(test.freedom for test in tests)
    assert freedom == 3 * sum(test.count for test in tests)
    assert_chi_square(sum(test.nis * test.freedom for test in tests), freedom)


def test_a_star_tracker_off_by_a_degree_shows_in_its_innovations():
    def off(flight, timeline):
        for k in range(0, len(timeline.t_s), EVERY):
            R_nb = flight.truth.R_nb[np.abs(flight.truth.t_s - timeline.t_s[k]).argmin()]
            yield own(k, R_nb @ gtsam.Rot3.Rx(np.radians(1.0)).matrix())

    found = shared(Smoother(lag_s=2.0, factors=(off,)), flown("demo", SPAN_S, SEEDS[0]))
    assert next(test.nis for test in found.consistency if test.what == NAME) > 4


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_residual_of_ones_own_is_gtsams_own_factor(method):
    one, other = (estimated(method, SEEDS[0], native) for native in (False, True))
    assert np.abs(log(transpose(one.R_nb) @ other.R_nb)).max() < 1e-8
    sigma = np.sqrt(np.einsum("nii->ni", one.attitude_covariance_rad2))
    apart = one.attitude_covariance_rad2 - other.attitude_covariance_rad2
    assert (np.abs(apart) < 1e-5 * sigma[:, :, None] * sigma[:, None]).all()


def test_a_stream_takes_a_star_tracker_too():
    rng, nees, freedom = np.random.default_rng(20_004), 0.0, 0
    case = flights.turning(rng, span_s=SPAN_S)
    measured = drawn(case.truth.R_nb, 7)

    def source(_, timeline):
        if timeline.new % EVERY == 0:
            yield own(timeline.new, measured[timeline.new])

    given = {k: (own(k, measured[k]),) for k in range(0, len(measured), EVERY)}
    without, found, handed = streamed(case), streamed(case, (source,)), streamed(case, (), given)
    error = [flights.attitude_errors_rad(e.R_nb, case.truth) for e in (without, found)]
    assert rms(error[1]) < 0.95 * rms(error[0])
    assert rms(error[1][::EVERY]) < 1.2 * np.sqrt(3) * SIGMA_RAD < 0.4 * rms(error[0][::EVERY])
    nees += squares(error[1], found.attitude_covariance_rad2)[::EVERY].sum()
    freedom += 3 * len(error[1][::EVERY])
    assert_chi_square(nees, freedom)
    np.testing.assert_array_equal(handed.R_nb, found.R_nb)
    assert {one.what for one in found.consistency} == {"star tracker"}
    tested = sum(one.freedom for one in found.consistency)
    assert tested == 3 * len(range(0, len(measured), EVERY))
    assert_chi_square(sum(one.nis * one.freedom for one in found.consistency), tested)


def streamed(case, sources=(), given=None):
    """Return each keyframe of a flight as it leaves a stream."""
    stream, left = stream_of(case, sources), []
    for k in range(len(case.problem.t_s)):
        factors = (given or {}).get(k, ())
        left.append(stream.update(dataclasses.replace(measurements(case, k), factors=factors)))
    left = [part for part in (*left, stream.flush()) if len(part.t_s)]
    joined = concatenate_estimates(left, len(case.problem.t_s), len(case.problem.t_s))
    tests = tuple(one for part in left for one in part.consistency)
    return dataclasses.replace(joined, consistency=tests)


def stream_of(case, sources=()):
    config = StreamConfig(
        origin=flights.ORIGIN, antenna_b_m=np.zeros(3), rate_prior=case.rate_prior
    )
    return Stream(config, 2.0, factors=sources)


def measurements(case, k):
    """Return what came in up to keyframe k."""
    t_s, imu = case.problem.t_s[k], case.imu
    near = (imu.t_s > t_s - 0.25) & (imu.t_s < t_s + 0.15)
    position, speed = (
        Measured(value=series.value[k], covariance=series.covariance[k])
        for series in (case.position, case.velocity)
    )
    return Measurements(
        t_s=float(t_s),
        imu=dataclasses.replace(imu, t_s=imu.t_s[near], f_b_mps2=imu.f_b_mps2[near]),
        array=case.form[np.array([k])],
        position=position,
        velocity=speed,
    )


def flat(k, residual=lambda v: v, **more):
    """Return a factor on one velocity that says next to nothing."""
    return residual_factor("mine", [velocity(k)], residual, 1e3 * np.ones(3), **more)


UNIT = gtsam.noiseModel.Unit
WRONG = {
    "not a number later on": (
        lambda k: flat(k, lambda v: v * np.nan if k > 20 else v),
        "factor 'mine' on v40: residual is not finite",
    ),
    "a variable of flights with a gyroscope": (
        lambda k: residual_factor("mine", [imu_bias(k)], lambda b: b.vector(), np.ones(6)),
        "factor 'mine': b0 is no variable of the flight, which has keyframes 0 to 59 of pose, "
        "velocity and angular_motion, and 1 constants",
    ),
    "a constant that is not estimated": (
        lambda _: residual_factor("mine", [constant(7)], lambda c: c, np.ones(3)),
        "factor 'mine': c7 is no variable of the flight",
    ),
    "a keyframe that is not there": (
        lambda k: flat(k + 1000),
        "factor 'mine': v1000 is no variable of the flight",
    ),
    "no key of this graph": (
        lambda _: residual_factor("mine", [7], lambda v: v, np.ones(3)),
        "factor 'mine': 7 is no variable of the flight",
    ),
    "GTSAM's factor of another type": (
        lambda k: gtsam.PriorFactorVector(pose(k), np.zeros(3), UNIT.Create(3)),
        "factor 'PriorFactorVector': Attempting to retrieve",
    ),
    "GTSAM's factor of another size": (
        lambda k: gtsam.PriorFactorVector(velocity(k), np.zeros(4), UNIT.Create(4)),
        "factor 'PriorFactorVector': ",
    ),
    "GTSAM's factor that is not a number": (
        lambda k: gtsam.PriorFactorVector(velocity(k), np.full(3, np.nan), UNIT.Create(3)),
        "factor 'PriorFactorVector': its error is not finite",
    ),
    "no factor": (
        lambda _: "wheel",
        "factors: must be gtsam factors or residual_factor's, got str",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_what_is_wrong_with_a_factor_is_one_line(method, wrong):
    make, text = WRONG[wrong]
    method = dataclasses.replace(method, factors=(lambda *_: [make(k) for k in (0, 20, 40)],))
    with pytest.raises(BadInputError, match="^" + text) as raised:
        shared(method, flown("demo", 6.0))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("method", [Smoother(lag_s=1.0), Forward()], ids=lambda m: m.name)
def test_a_factor_that_reaches_beyond_the_window_is_refused_and_the_batch_takes_it(method):
    def loop(*_):
        yield residual_factor(
            "loop", [velocity(5), velocity(55)], lambda v, w: w - v, 1e3 * np.ones(3)
        )

    flight = flown("demo", 6.0)
    text = (
        "^factor 'loop': joins keyframes 5.00 s apart, 0.50 and 5.50 s, further than the window "
        "reaches; use a longer lag or the batch"
    )
    with pytest.raises(BadInputError, match=text):
        shared(dataclasses.replace(method, factors=(loop,)), flight)
    for reaching in (Batch(), dataclasses.replace(method, lag_s=7.0)):
        assert shared(dataclasses.replace(reaching, factors=(loop,)), flight).converged


def test_a_stream_names_what_is_wrong_with_a_factor():
    case = flights.turning(np.random.default_rng(20_005), span_s=5.0)
    wrong = {
        "v9 is no variable": flat(9),
        "b4 is no variable": residual_factor("mine", [imu_bias(4)], lambda b: b, np.ones(6)),
        "must touch the keyframe it enters with, 4": flat(3),
        "residual has shape": flat(4, lambda v: v[:1]),
    }
    for text, factor in wrong.items():
        with pytest.raises(BadInputError, match=f"^factor 'mine'.*{text}"):
            streamed(case, given={4: (factor,)})
    far = residual_factor("mine", [velocity(1), velocity(40)], lambda v, w: w - v, np.ones(3))
    with pytest.raises(BadInputError, match="touches keyframe 1, which has left the window"):
        streamed(case, given={40: (far,)})


def test_a_source_that_yields_nothing_of_use_is_named():
    def forgetful(*_):
        return None

    with pytest.raises(BadInputError, match="source of factors forgetful: must yield factors"):
        shared(Batch(factors=(forgetful,)), flown("demo", 6.0))


def test_without_a_gyroscope_a_factor_may_speak_of_the_rate():
    """A rate sensor about one axis: its keys are those of the timeline."""
    flight = flown("demo", 6.0)

    def source(_, timeline):
        assert not timeline.gyroscope
        for k in range(0, len(timeline.t_s), 5):
            yield residual_factor("tachometer", [angular_motion(k)], lambda m: m[3:4], [10.0])

    found = shared(Batch(factors=(source,)), flight)
    assert next(test.count for test in found.consistency if test.what == "tachometer") == 12


@pytest.fixture
def installed(monkeypatch):
    """Let a package be installed that brings a star tracker."""
    entry = EntryPoint(
        name="stars", value="tests.methods.test_custom_factors:STARS", group="fgnav.factors"
    )
    monkeypatch.setattr(
        plugins, "entry_points", lambda group: [entry] if group == "fgnav.factors" else []
    )


STARS = StarTracker()


@pytest.mark.usefixtures("installed")
def test_an_installed_source_goes_by_its_name_on_the_command_line(tmp_path, capsys):
    save_flight(flown("demo", 5.0), tmp_path / "flight")
    words = ["run", str(tmp_path / "flight"), "--integers", "truth", "--out", str(tmp_path / "out")]
    assert cli.main([*words, "--factors", "stars"]) == 0
    assert NAME in (tmp_path / "out" / "summary.json").read_text()
    assert cli.main([*words, "--factors", "moons"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("fgnav: source of factors 'moons': not one of stars; module:attribute")
    assert cli.main([*words, "--factors", "stars", "--method", "rtk"]) == 2
    assert "smoother, forward, batch use it" in capsys.readouterr().err

"""Rates that come and go between fixes: an aircraft that rolls, seen once a second."""

import numpy as np
import pytest

from fgnav import rotations
from fgnav.flight import Antenna, Fixes, Flight, Imu, Truth
from fgnav.methods.smoother import Batch, links
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.chain import STATE, Chain
from fgnav.methods.smoother.linear import blocks_of, log_likelihood
from fgnav.methods.smoother.link_kernel import linearise
from fgnav.methods.smoother.quick_rates import with_quick_rates
from fgnav.methods.smoother.smoother import collected_for
from tests.methods.simulated import errors_rad, nees

from .flights import ORIGIN, turning

HZ, SPEED_MPS, G_MPS2 = 50, 20.0, 9.8
NOISE = 0.05  # (rad/s)2/Hz, of the roll rate
GONE_S = 0.2  # correlation of the roll rate
LEVEL_S = 2.0  # and what brings the wings back


def rolling(seed, span_s=60.0):
    """A flight that rolls at random and turns as its bank has it, lift along -z_b."""
    rng, dt = np.random.default_rng(seed), 1 / HZ
    n = round(span_s * HZ) + 1
    roll, rate, yaw = np.zeros(n), 0.0, np.zeros(n)
    white = rng.standard_normal(n) * np.sqrt(NOISE * dt) / GONE_S
    for k in range(1, n):
        rate += white[k] - rate * dt / GONE_S
        roll[k] = roll[k - 1] + (rate - roll[k - 1] / LEVEL_S) * dt
        yaw[k] = yaw[k - 1] + G_MPS2 * np.tan(roll[k]) / SPEED_MPS * dt
    t_s, zero = dt * np.arange(n), np.zeros(n)
    v_n = SPEED_MPS * np.stack([np.cos(yaw), np.sin(yaw), zero], axis=1)
    p_n = np.cumsum(v_n, axis=0) * dt
    g = np.linalg.norm(ORIGIN.gravity_n_mps2(p_n), axis=1)
    f_b = np.stack([zero, zero, -g / np.cos(roll)], axis=1) + 0.05 * rng.standard_normal((n, 3))
    fix = np.arange(0, n, HZ)
    return Flight(
        name="rolling",
        start_gps_s=0.0,
        origin=ORIGIN,
        antennas=(Antenna(name="gps", position_b_m=np.zeros(3)),),
        imu=Imu(
            t_s=t_s,
            f_b_mps2=f_b,
            accelerometer_noise_mps2_per_sqrt_hz=0.05 / np.sqrt(HZ),
            accelerometer_bias_mps2=0.01,
            accelerometer_bias_walk_mps2_per_sqrt_s=1e-3,
        ),
        fixes=Fixes(
            t_s=t_s[fix],
            antenna="gps",
            p_n_m=p_n[fix] + rng.standard_normal((len(fix), 3)),
            v_n_mps=v_n[fix] + 0.1 * rng.standard_normal((len(fix), 3)),
            position_sigma_m=np.ones((len(fix), 3)),
            velocity_sigma_mps=np.full((len(fix), 3), 0.1),
        ),
        truth=Truth(t_s=t_s, p_n_m=p_n, v_n_mps=v_n, R_nb=rotations.from_euler(roll, zero, yaw)),
    )


def test_what_goes_between_fixes_is_stated():
    """By the walk alone errors of roll are 2.5 to 3.6 sigmas, and the squares of all 8 to 15."""
    for seed in range(3):
        flight = rolling(seed)
        walk = solve_batch(collected_for(Batch(), flight).keyframes)
        estimate = Batch()(flight)
        error, roll = errors_rad(flight, estimate), estimate.attitude_covariance_rad2[:, 0, 0]
        assert (error[:, 0] ** 2).mean() / walk.covariance[:, 0, 0].mean() > 2.0**2
        assert 0.7**2 < (error[:, 0] ** 2).mean() / roll.mean() < 1.3**2
        assert nees(error, estimate.attitude_covariance_rad2) < 3
        assert any("comes and goes between fixes" in note for note in estimate.notes)


def test_a_stated_intensity_is_all_there_is():
    flight = rolling(0)
    estimate = Batch(angular_acceleration_density=0.05)(flight)
    assert not any("comes and goes" in note for note in estimate.notes)


def test_a_steady_flight_has_next_to_none():
    """Where all is smooth the likelihood is flat, and what keeps it off zero is small."""
    seen = turning(np.random.default_rng(0), amplitude_deg=0.0, span_s=30.0).keyframes
    quick = with_quick_rates(seen, solve_batch(seen))
    assert (quick.preintegrate.rate_density < 1e-4).all()


def test_the_likelihood_is_that_of_one_dense_system():
    """States integrated out all at once."""
    seen = turning(np.random.default_rng(0), span_s=1.0).keyframes
    n = len(seen.t_s)

    def dense(block):
        motions, rows = links.empty_motions(n), np.arange(n)
        links.integrate(motions, rows[1:], block.samples, rows[1:], block.states.slot[:-1])
        chain = Chain.empty(n, 0)
        linearise(chain.link, block.states, motions, block.senses, block.prior, rows, 0)
        whole, end = np.zeros((STATE * n + 1,) * 2), STATE * n
        for k in range(n):
            at = np.append(np.arange(STATE * (k - 1), STATE * (k + 1)), end)
            if k == 0:
                whole[np.ix_(at[STATE:], at[STATE:])] += chain.link[0, STATE:, STATE:]
            else:
                whole[np.ix_(at, at)] += chain.link[k]
        H, g = whole[:end, :end], whole[:end, end]
        cost = whole[end, end] - g @ np.linalg.solve(H, g)
        white = sum(np.linalg.slogdet(one)[1] for one in motions.white[1:])
        return white - np.linalg.slogdet(H)[1] / 2 - cost / 2

    block = next(iter(blocks_of(seen, [0], n)))
    noise = block.samples.noise.copy()
    noise[:, 2:] *= 7.0
    louder = block._replace(samples=block.samples._replace(noise=noise))
    for one in (block, louder):
        assert log_likelihood(one) == pytest.approx(dense(one), abs=1e-6)

# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Streaming
#
# A vehicle cannot wait for its recording to end. A `Stream` is the smoother's window fed keyframe
# by keyframe: it states the newest state at once, and the smoothed one a lag later, with memory
# that the lag bounds.

# %%
from dataclasses import replace
from time import perf_counter

import matplotlib.pyplot as plt
import msgspec
import numpy as np

from fgnav.assembly.truncation import truncated
from fgnav.geometry import rotations
from fgnav.gnss.single_point.solution import code_solution
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.methods.smoother import Forward
from fgnav.methods.stream import Measured, Measurements, Stream, StreamConfig
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

# %% [markdown]
# ## What comes in
# One antenna at 10 Hz, inertial samples at 100 Hz with a gyroscope, a magnetometer. The flight is
# simulated as a whole; the loop below hands out no more of it than instruments would have by then.

# %%
scenario = load_scenario("surroundings")
gnss = msgspec.structs.replace(scenario.gnss, outages=())
scenario = msgspec.structs.replace(scenario, duration_s=30.0, gnss=gnss)
flight = simulate(scenario, np.random.default_rng(3))
imu, compass = flight.imu, flight.magnetometer
fixes = code_solution(flight, causal=True)  # each epoch by its own code and Doppler


def keyframe(k):
    """Return what came in up to an epoch since the one before."""
    t_s = fixes.t_s[k]
    near = (imu.t_s > t_s - 0.12) & (imu.t_s <= t_s)
    record = {name: getattr(imu, name)[near] for name in ("t_s", "f_b_mps2", "w_b_radps")}
    read = np.searchsorted(compass.t_s, t_s + 1e-6) - 1
    return Measurements(
        t_s=float(t_s),
        imu=replace(imu, **record),
        position=Measured(value=fixes.p_n_m[k], covariance=fixes.position_covariance_m2[k]),
        velocity=Measured(value=fixes.v_n_mps[k], covariance=fixes.velocity_covariance_m2ps2[k]),
        field_b_ut=compass.field_b_ut[read],
    )


# %% [markdown]
# ## Running
# The first keyframe says where to look for the attitude: level, along the velocity. Every update
# returns the keyframes that leave the window by it, smoothed; `newest` is what a controller would
# take.

# %%
config = StreamConfig(
    origin=flight.origin, antenna_b_m=flight.antennas[0].position_b_m, magnetometer=compass
)
stream = Stream(config, lag_s=3.0)
course_rad = np.arctan2(fixes.v_n_mps[:1, 1], fixes.v_n_mps[:1, 0])
level = rotations.from_euler(np.zeros(1), np.zeros(1), course_rad)[0]

newest, smoothed, seconds = [], [], []
for k in range(len(fixes.t_s)):
    measured = keyframe(k) if k else replace(keyframe(k), R_nb=level)
    started_s = perf_counter()
    smoothed.append(stream.update(measured))
    newest.append(stream.latest())
    seconds.append(perf_counter() - started_s)
smoothed.append(stream.flush())
late = 1e3 * np.array(seconds[10:])
print(f"{np.median(late):.1f} ms an update, 99 % below {np.percentile(late, 99):.1f} ms,", end="")
print(" while the next epoch is 100 ms away")

# %% [markdown]
# ## What waiting is worth
# Three seconds later more is known of every epoch. Both state how well they know it.


# %%
def judged(parts):
    """Return times, errors of the heading and what is stated of them, deg."""
    parts = [part for part in parts if len(part.t_s)]
    t_s, R_nb, sigma_deg = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("t_s", "R_nb", "sigma_deg")
    )
    R_true, _ = attitude_at(flight.truth, t_s)
    apart = rotations.to_euler(R_nb) - rotations.to_euler(R_true)
    return t_s, np.degrees(rotations.wrap(apart))[:, 2], sigma_deg[:, 2]


figure, axes = plt.subplots(figsize=(9, 3.6), layout="constrained")
for name, parts, colour in (("newest", newest, "C0"), ("3 s later", smoothed, "C3")):
    t_s, error_deg, sigma_deg = judged(parts)
    axes.fill_between(t_s, -3 * sigma_deg, 3 * sigma_deg, color=colour, alpha=0.15, lw=0)
    axes.plot(t_s, error_deg, color=colour, label=f"{name}, shaded: ±3σ")
    inside = (np.abs(error_deg) < 3 * sigma_deg).mean()
    rms_deg = np.sqrt((error_deg**2).mean())
    print(f"{name:9} heading RMS {rms_deg:.2f} deg, {inside:.1%} within 3 sigma")
    assert inside > 0.9
axes.set(xlabel="time, s", ylabel="heading error, deg", ylim=(-12, 12))
_ = axes.legend()

# %% [markdown]
# ## Raw observations
# An `ObservationStream` needs no solution of a receiver: code, phase and Doppler of each epoch go
# in as they are, with the inertial samples since. It builds the problem that `forward` builds of a
# file, so a flight that is replayed ends where `forward` ends.

# %%
raw = truncated(replace(flight, magnetometer=None, barometer=None, photodetector=None), 6.0)
stated = Forward(noise="nominal")
answers, seconds = [], []
started_s = perf_counter()
for answer in Stream.replay(raw, stated):
    seconds.append(perf_counter() - started_s)
    answers.append(answer)
    started_s = perf_counter()
whole = stated(raw)
streamed = np.concatenate([answer.R_nb for answer in answers])
print(
    f"{len(whole.t_s)} epochs, attitudes apart by {np.abs(streamed - whole.R_nb).max():.0e}", end=""
)
print(f"; {1e3 * np.median(seconds):.0f} ms an epoch, front end and window")
assert np.allclose(streamed, whole.R_nb, rtol=0, atol=1e-9)

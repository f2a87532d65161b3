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
# # A recording, smoothed
#
# Two files of a logger become a flight folder, `fgnav check` says what is wrong with it, two edits
# mend that, and the smoother crosses fifteen seconds without satellites. The files are those of a
# car, where the folder of reference data is there (`FGNAV_SHARED`); else a simulated flight writes
# files of the same kind. There is no truth: the fixes withheld in the gap are the judge.

# %%
import json
import os
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import msgspec
import numpy as np

import fgnav
from fgnav.cli import main
from fgnav.evaluation.span import within
from fgnav.io.flight.local_frame import place_of_n
from fgnav.methods.smoother import Batch, Smoother
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

folder = Path(mkdtemp())
recorded = Path(os.environ.get("FGNAV_SHARED", "")) / "data" / "flights" / "drive_0708"


def simulated_files():
    """Write what a logger would have."""
    scenario, arc = load_scenario("surroundings"), load_scenario("demo").motion.path
    motion = msgspec.structs.replace(scenario.motion, path=arc)
    scenario = msgspec.structs.replace(scenario, motion=motion, duration_s=150.0)
    flight = simulate(scenario, np.random.default_rng(2))
    imu = flight.imu
    samples = [1e3 * imu.t_s, *(imu.f_b_mps2 / 9.80665).T, *np.degrees(imu.w_b_radps).T]
    header = "time [ms],ax [g],ay,az,gx [deg/s],gy,gz"
    table = np.column_stack(samples)
    np.savetxt(folder / "imu.csv", table, fmt="%.6f", delimiter=",", header=header, comments="")
    t_s = flight.truth.t_s[::25]
    place = place_of_n(flight.origin, flight.truth.p_n_m[::25])
    v_n_mps = flight.truth.v_n_mps[::25]
    head = "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m)"
    head += " sdne(m) sdeu(m) sdun(m) age(s) ratio vn(m/s) ve(m/s) vu(m/s)"
    rows = [
        f"2111 {345600 + t:.3f} {lat:.9f} {lon:.9f} {up:.4f} 1 12 0.01 0.01 0.02 0 0 0 0 9"
        f" {north:.3f} {east:.3f} {-down:.3f}"
        for t, (lat, lon, up), (north, east, down) in zip(t_s, place, v_n_mps, strict=True)
    ]
    (folder / "rover.pos").write_text("\n".join([head, *rows, ""]))
    return folder / "imu.csv", folder / "rover.pos"


is_real = recorded.is_dir()
files = (recorded / "imu_1934.csv", recorded / "gnss_1934_sf.pos") if is_real else simulated_files()
print("the car" if is_real else "simulated:", *(file.name for file in files))

# %% [markdown]
# ## From files to a flight
# `fgnav new` tells each format by its content and writes a `flight.toml` that says, marked EDIT,
# what no file states. (In a shell: `fgnav new imu.csv rover.pos --out flight`.)

# %%
assert main(["new", *map(str, files), "--out", str(folder / "flight")]) == 0

# %% [markdown]
# ## What is wrong with it
# How the inertial unit sits and how its clock runs shows when it is held against the fixes.


# %%
def findings():
    said = StringIO()
    with redirect_stdout(said):
        main(["check", str(folder / "flight"), "--json", "-"])
    return json.loads(said.getvalue())["findings"]


found = {finding["name"]: finding for finding in findings()}
for finding in found.values():
    print(f"{finding['name']}: {finding['text']}; {finding['mend']}")

# %% [markdown]
# Of the car two of them are edits of `flight.toml`, and what it may be taken to do is a third:
# wheels do not slide to the side. What is left is the receiver's own: its velocities are means
# since the fix before, which the smoother can estimate.

# %%
toml = folder / "flight" / "flight.toml"
text = toml.read_text()
if "imu mounting" in found:
    text = text.replace('axes = ["x", "y", "z"]', 'axes = ["-x", "y", "-z"]')
if "imu clock" in found:
    seconds = found["imu clock"]["mend"].split()[1]
    text = text.replace("clock_offset_s = 0.0", f"clock_offset_s = {seconds}")
if is_real:
    text += '\n[vehicle]\nkind = "wheeled"\n'
toml.write_text(text)
print([finding["name"] for finding in findings()])

# %% [markdown]
# ## Smoothing across a gap
# Two minutes of it, with the fixes of fifteen seconds withheld, by a window that looks five
# seconds ahead and by the batch that knows both ends of the gap. Both solve the problem that one
# of them prepares: there noise that the files do not state is identified from the flight.

# %%
flight = within(fgnav.load_flight(folder / "flight"), 20.0, 140.0)
fixes = flight.fixes[0]
withheld = (fixes.t_s > 100.0) & (fixes.t_s < 115.0)
rows = {
    name: getattr(fixes, name)[~withheld]
    for name in ("t_s", "p_n_m", "v_n_mps", "position_sigma_m", "velocity_sigma_mps")
}
holed = replace(flight, fixes=(replace(fixes, **rows),))
methods = (Smoother(calibrate=("velocity-delay",)), Batch(calibrate=("velocity-delay",)))
prepared = methods[0].prepare(holed)
estimates = {method.name: method.estimate_prepared(holed, prepared) for method in methods}
for note in estimates["batch"].notes[:5]:
    print(note)

# %% [markdown]
# ## The judge
# In the gap the inertial unit is alone. How far is each method from the fixes that it never saw,
# and does it say so?

# %%
arm_b_m = flight.antenna(fixes.antenna).position_b_m
t_s, judge_n_m = fixes.t_s[withheld], fixes.p_n_m[withheld]


def at(times_s, columns):
    return np.column_stack([np.interp(t_s, times_s, column) for column in columns.T])


figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
for colour, (name, estimate) in zip(("C3", "C2"), estimates.items(), strict=True):
    antenna_n_m = estimate.p_n_m + estimate.R_nb @ arm_b_m
    variance_m2 = np.einsum("nii->ni", estimate.position_covariance_m2)
    error_m = at(estimate.t_s, antenna_n_m) - judge_n_m
    sigma_m = np.sqrt(at(estimate.t_s, variance_m2))
    spread_m = np.hypot(sigma_m, fixes.position_sigma_m[withheld])
    rms, stated = (np.sqrt((values**2).mean(axis=0)).round(2) for values in (error_m, sigma_m))
    nees = ((error_m / spread_m) ** 2).sum(axis=1).mean()
    print(f"{name:9} RMS {rms} m north, east, down; stated {stated}; {nees:.1f} of 3")
    for k, axis in enumerate(("north", "east", "down")):
        axes[k].fill_between(t_s, -3 * sigma_m[:, k], 3 * sigma_m[:, k], color=colour, alpha=0.15)
        axes[k].plot(t_s, error_m[:, k], color=colour, label=f"{name}, shaded: ±3σ")
        axes[k].set(xlabel="time, s", ylabel=f"error {axis}, m")
_ = axes[0].legend()

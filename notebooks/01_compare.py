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
# # One flight in, one comparison out
#
# Twenty seconds of a vehicle that sways by 20° about all axes, with eight GNSS antennas and an
# accelerometer but no gyroscope. We make the flight, write it and read it as if it were a
# recording, resolve the integers of its carrier phase, estimate its attitude in four ways and
# judge them.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
from IPython.display import Image

import fgnav
from fgnav.evaluation.report.save import save_report
from fgnav.geometry import rotations
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.integers.resolvers.resolve import resolve
from fgnav.methods import method_named
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

# %% [markdown]
# ## A flight
# A scenario and a seed make a flight, truth included. On disk a simulated flight looks like a
# recorded one: RINEX observations and navigation, tables of the other sensors.

# %%
scenario = msgspec.structs.replace(load_scenario("demo"), duration_s=20.0)

with TemporaryDirectory() as folder:
    fgnav.save_flight(simulate(scenario, np.random.default_rng(1)), Path(folder) / "flight")
    flight = fgnav.load_flight(Path(folder) / "flight")

print([antenna.name for antenna in flight.antennas])
print(len(flight.observations.t_s), "epochs,", len(flight.observations.satellites), "channels")

# %% [markdown]
# ## Integers
# A double difference of carrier phase is good to millimetres once its whole cycles are known. The
# search looks at all baselines at once.

# %%
resolver = resolver_named("lambda")
differences, integers = resolve(flight, resolver)
print(f"{integers.fixed.sum()} of {differences.resolvable.sum()} integers fixed")

# %% [markdown]
# ## Smoothing
# A factor graph joins the fixed phases of all epochs through the accelerometer. Its attitude comes
# with a covariance.

# %%
estimate = fgnav.Smoother(resolver=resolver)(flight)
euler_deg = np.degrees(rotations.to_euler(estimate.R_nb))
print("roll, pitch, yaw at the end, deg:", euler_deg[-1].round(2))

# %% [markdown]
# ## Comparing
# `fgnav.compare` runs any number of estimators, the user's own among them: anything with a name
# that turns a flight into an `Estimate`.

# %%
names = ["closed-form", "maximum-likelihood", "smoother", "rtk"]
comparison = fgnav.compare(flight, [method_named(name, resolver) for name in names])
for method in comparison.methods:
    rmse = method.score.rmse_deg
    print(f"{method.name:20} {rmse.roll:6.3f} {rmse.pitch:6.3f} {rmse.yaw:6.3f} deg")
bound = comparison.bound
print(f"{'bound of one epoch':20} {bound.roll:6.3f} {bound.pitch:6.3f} {bound.yaw:6.3f} deg")

# %% [markdown]
# The smoother is better than the bound of one epoch: it looks at all of them.

# %%
smoother = comparison["smoother"].score
assert smoother.rmse_deg.roll < bound.roll
assert comparison["maximum-likelihood"].score.rmse_deg.roll < 1.3 * bound.roll
smoother.attitude_nees_mean

# %%
with TemporaryDirectory() as folder:
    save_report(comparison, flight, Path(folder) / "report.png")
    picture = Image((Path(folder) / "report-errors.png").read_bytes(), width=900)
picture

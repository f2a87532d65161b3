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
# # Factor-graph navigation with neural measurement factors
#
# Attitude and position in a GTSAM sliding window with factors of a gravity network, of baselines
# whose double differences a network has fixed, of the line of sight and of an accelerometer; beside
# it the closed form of the source paper and an RTK reference. This page is that sentence in code.

# %%
import numpy as np

import fgnav
from fgnav.evaluation.ablation import restricted
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods.closed_form import ClosedForm
from fgnav.methods.rtk import Rtk
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

# %% [markdown]
# A civil rocket with fins: eight antennas, an accelerometer, no gyroscope. A photodetector sees a
# beacon in the last part. For seven seconds the array is lost, for four all GNSS.

# %%
flight = simulate(load_scenario("paper"), np.random.default_rng(1))
flight

# %% [markdown]
# A network resolves the integers; another finds gravity in body axes wherever its training covers
# the flight. The smoother takes both, and says what its graph was made of.

# %%
network = resolver_named("network")
smoother = fgnav.Smoother(resolver=network, factors=("gravity",), noise="nominal")
estimate = smoother(flight)
print(estimate.graph)
for name, answers in estimate.graph.networks.items():
    print(name, answers)

# %% [markdown]
# The same flight by three methods, then by the smoother without each kind of factor.

# %%
kinds = ("baselines", "gravity", "line-of-sight")
ablated = [restricted(f"smoother without {kind}", smoother, (kind,)) for kind in kinds]
methods = [
    ClosedForm(resolver=network, factors=("gravity",)),
    Rtk(resolver=network),
    smoother,
    *ablated,
]
for method in fgnav.compare(flight, methods).methods:
    score = method.score
    print(f"{method.name:30} {score.attitude_rmse_deg:7.3f} deg, {score.available:4.0%} of epochs")

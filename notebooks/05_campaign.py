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
# # A campaign and its statistics
#
# One flight is an anecdote. A campaign flies a scenario many times, runs every method on every
# flight, and says how sure the difference is: flights are the unit, paired, because the same
# flight is hard for all.

# %%
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from fgnav.cli import main
from fgnav.evaluation.paired import paired

folder = Path(mkdtemp())

# %% [markdown]
# ## The order
# Two methods, two numbers of satellites, six flights each at any hour of the day. Every random
# number grows from one seed.

# %%
ORDER = """
seed = 7
flights = 6
baseline = "maximum likelihood"

[[method]]
name = "maximum likelihood"
method = "maximum-likelihood"

[[method]]
method = "smoother"

[[case]]
name = "satellites"
scenario = "demo"
any_hour = true
changes = { duration_s = 5.0 }

[case.sweep]
name = "satellites"
values = [5, 8]
keys = { "gnss.choose" = [5, 8] }
"""
(folder / "order.toml").write_text(ORDER)
command = ["campaign", str(folder / "order.toml"), "--out", str(folder / "out"), "--workers", "2"]
assert main(command) == 0

# %% [markdown]
# ## More flights
# The number of flights is no part of what decides a run: raise it and go on with `--resume`. What
# is there stays; a campaign that was killed goes on the same way.

# %%
(folder / "order.toml").write_text(ORDER.replace("flights = 6", "flights = 10"))
assert main([*command, "--resume"]) == 0

# %% [markdown]
# ## The figures
# A row for each flight and method. Pooled over flights the smoother is better; the interval says
# by how much, the signed-rank test whether it may be chance.

# %%
table = pd.read_csv(folder / "out" / "flights.csv")
by_method = table.pivot(index=["value", "flight"], columns="method", values="attitude_rmse_deg")
for satellites, own in by_method.groupby("value"):
    first, second = own["smoother"].to_numpy(), own["maximum likelihood"].to_numpy()
    held = paired(first, second, np.random.default_rng(1))
    value, low, high = held.ratio.value, held.ratio.low, held.ratio.high
    print(f"{satellites:g} satellites: ratio of RMSE {value:.2f} [{low:.2f}, {high:.2f}],", end="")
    print(f" p = {held.p_value:.4f}, {held.flights} flights")
    assert held.is_significant

# %% [markdown]
# Why pairs? Skies differ by more than methods do. Flights scatter along the diagonal; what counts
# is on which side of it they are.

# %%
figure, axes = plt.subplots(figsize=(4.6, 4.2), layout="constrained")
for satellites, own in by_method.groupby("value"):
    axes.loglog(own["maximum likelihood"], own["smoother"], "o", label=f"{satellites} satellites")
ends = [by_method.min().min(), by_method.max().max()]
axes.loglog(ends, ends, "--", color="0.5")
axes.set(xlabel="maximum likelihood, RMSE deg", ylabel="smoother, RMSE deg")
_ = axes.legend()

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
# # Integers and their probability
#
# Carrier phase is good to millimetres once its whole cycles are known, and off by decimetres where
# they are wrong. So a resolver must say how likely it is wrong, and refuse when it cannot tell.
# Here that probability is held against what became of it, on flights whose integers are known.

# %%
import matplotlib.pyplot as plt
import numpy as np

from fgnav.evaluation.integer_counts import integers_at, true_attitudes
from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.integers.resolvers.resolve import resolve
from fgnav_sim.flight_source import Simulator

# %% [markdown]
# ## Flights that are hard to fix
# Three antennas see five satellites by code of 0.6 m: rounding is hopeless, and even the best
# search is wrong now and then. Eight flights of five seconds start at hours of their own, under
# skies of their own.

# %%
hard = {
    "duration_s": 5.0,
    "antennas_b_m": [[0.0, 0.0, 0.0], [0.5, 0.3, 0.0], [-0.2, 0.6, 0.1]],
    "gnss.choose": 5,
    "gnss.receiver_mask_deg": 10.0,
    "gnss.code_noise_m": 0.6,
}


def flown(seed):
    rng = np.random.default_rng(seed)
    return Simulator().fly("demo", hard, int(rng.integers(86_400)), rng)


flights = [flown(seed) for seed in range(8)]

# %% [markdown]
# ## Who is right, and who knows
# Each epoch is resolved by itself. It is right where all its integers are those that the true
# attitude implies.


# %%
def outcomes(resolver):
    """Return, of all epochs, whether fixed, whether right, and the probability to be wrong."""
    fixed, right, stated = [], [], []
    for flight in flights:
        differences, integers = resolve(flight, resolver)
        truth = integers_at(differences, *true_attitudes(flight.truth, differences.t_s))
        same = (integers.cycles == truth.cycles) | ~integers.fixed
        fixed.append(integers.fixed.any(axis=(1, 2)))
        right.append(same.all(axis=(1, 2)))
        chance = integers.wrong_probability
        stated.append(np.full(len(same), np.nan) if chance is None else chance)
    return np.concatenate(fixed), np.concatenate(right), np.concatenate(stated)


for name in ("rounding", "lambda", "constrained", "constrained-arcs"):
    fixed, right, _ = outcomes(resolver_named(name))
    wrong = (fixed & ~right).sum() / max(fixed.sum(), 1)
    print(f"{name:17} {fixed.mean():6.1%} of epochs fixed, {wrong:6.2%} of these wrong")

# %% [markdown]
# `rounding` and `lambda` accept what they find, wrong or not. `constrained` knows the array's
# shape and accepts so much that 1 % may be wrong; `constrained-arcs` lets the epochs of an arc,
# which share their integers, decide together.
#
# ## Is the probability true?
# Let it accept everything, and sort the epochs by what it states: of those that are wrong with a
# chance of 10 %, one in ten should be.

# %%
_, right, stated = outcomes(Constrained(wrong_max=None, tail=None))
parts = np.array_split(np.argsort(stated)[-len(stated) // 2 :], 6)  # the rest is as good as sure
mean = np.array([stated[part].mean() for part in parts])
seen = np.array([(~right[part]).mean() for part in parts])
spread = np.array([np.sqrt((stated[p] * (1 - stated[p])).sum()) / len(p) for p in parts])

figure, axes = plt.subplots(figsize=(5, 4.2), layout="constrained")
axes.plot([0, 1], [0, 1], "--", color="0.5", label="true")
axes.errorbar(mean, seen, 2 * spread, fmt="o", label="seen, ±2σ of as many epochs")
axes.set(xlabel="stated probability to be wrong", ylabel="share that is wrong")
axes.legend()
print(f"expected {stated.sum():.0f} wrong epochs, seen {(~right).sum()} of {len(right)}")

# %% [markdown]
# ## Accepting by it
# The threshold is a price list: what share is accepted for what share of wrong.

# %%
order = np.argsort(stated)
accepted = np.arange(1, len(order) + 1)
wrong_share = np.cumsum(~right[order]) / accepted
expected_share = np.cumsum(stated[order]) / accepted
figure, axes = plt.subplots(figsize=(5, 3.6), layout="constrained")
axes.plot(accepted / len(order), wrong_share, label="wrong among the accepted")
axes.plot(accepted / len(order), expected_share, "--", label="as stated")
axes.set(xlabel="share of epochs accepted", ylabel="share that is wrong")
_ = axes.legend()

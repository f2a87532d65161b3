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
# # Six tasks in a few lines each
#
# What one most often wants of the library, by what `import fgnav` offers. Arrays of one's own are
# here those of a simulated minute of driving, the network one that knows the heading.

# %%
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from onnx import TensorProto, helper

import fgnav
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

folder = Path(mkdtemp())
recorded = simulate(load_scenario("drone"), np.random.default_rng(1))
truth, imu, receiver = recorded.truth, recorded.imu, recorded.fixes[0]

# %% [markdown]
# ## A flight from arrays
# What is not stated of the noise is a usual figure, from which the estimate of it starts.

# %%
samples = imu.t_s, imu.f_b_mps2, imu.w_b_radps
fixes = {"fixes_t_s": receiver.t_s, "p_n_m": receiver.p_n_m, "v_n_mps": receiver.v_n_mps}
fixes["antenna_b_m"] = recorded.antennas[0].position_b_m
origin = fgnav.Origin.from_degrees(40.33, -3.88, 700.0)
flight = fgnav.Flight.from_arrays(*samples, origin=origin, **fixes)

# %% [markdown]
# ## Sigmas

# %%
estimate = fgnav.method("batch", noise="nominal")(flight)
print(estimate)
print(estimate.sigma_deg[-1], estimate.position_sigma_m[-1], estimate.velocity_sigma_mps[-1])


# %% [markdown]
# ## A factor of one's own
# A pump that weighs its fuel knows the vertical speed to 1 m/s.


# %%
def climb(_flight, timeline):
    speed = (lambda velocity: velocity[2:]), [1.0]
    for k in range(0, len(timeline.t_s), 20):
        yield fgnav.graph.residual_factor("climb", [fgnav.graph.velocity(k)], *speed)


with_climb = fgnav.Batch(noise="nominal", factors=(climb,))(flight)

# %% [markdown]
# ## A network of one's own
# Its file, then its manifest: what goes in, what comes out, and how sure it is. This one has
# learned nothing: whatever it sees, it answers with a heading of 0.5 rad, and a sigma of 3 rad.

# %%
rows = helper.make_node("ReduceMean", ["x"], ["mean"], axes=[1, 2], keepdims=0)
zero = helper.make_node("Sub", ["mean", "mean"], ["zero"])
column = helper.make_node("Unsqueeze", ["zero", "axis"], ["column"])
answer = helper.make_node("Add", ["column", "half"], ["y"])
nodes = [rows, zero, column, answer]
constants = [
    helper.make_tensor("axis", TensorProto.INT64, [1], [1]),
    helper.make_tensor("half", TensorProto.FLOAT, [1, 1], [0.5]),
]
seen = helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", 5, 3])
said = helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 1])
graph = helper.make_graph(nodes, "heading", [seen], [said], constants)
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
(folder / "net.onnx").write_bytes(model.SerializeToString())

# %%
known = {"format": "fgnav-factor/1", "name": "mine", "purpose": "Heading.", "licence": "MIT"}
shown = {"sensor": "gyroscope", "unit": "rad/s", "frame": "b", "rate_hz": 100.0, "window": 5}
shown |= {"mean": (0.0,) * 3, "scale": (1.0,) * 3, "range": ((-9.0, 9.0),) * 3}
answer = {"measures": "heading", "manifold": "S1", "unit": "rad", "frame": "n", "half_life_s": 1.0}
sure = fgnav.neural.Covariance(form="none", sigma=(3.0,))
inputs = (fgnav.neural.Input(name="x", **shown),)
output = fgnav.neural.Output(name="y", covariance=sure, **answer)
file = {"onnx": "net.onnx", "sha256": sha256((folder / "net.onnx").read_bytes()).hexdigest()}
manifest = fgnav.neural.Manifest(inputs=inputs, output=output, **known, **file)
fgnav.neural.save_manifest(manifest, folder / "net.json")
network = fgnav.NeuralFactor(folder / "net.json")
with_network = fgnav.Batch(noise="nominal", factors=(network,))(flight)

# %% [markdown]
# ## Two resolvers over several flights

# %%
scenario = load_scenario("six")
flights = {f"flight {k}": simulate(scenario, np.random.default_rng(k)) for k in (1, 2)}
resolvers = ("lambda", "constrained")
methods = {name: fgnav.method("maximum-likelihood", integers=name) for name in resolvers}
comparison = fgnav.compare(flights, methods)
print({name: comparison.figure("attitude_rmse_deg", name) for name in resolvers})

# %% [markdown]
# ## Errors with three sigma

# %%
errors = estimate.errors(truth)
print((np.abs(errors.euler_deg) < 3 * errors.sigma_deg).mean(axis=0))
fgnav.plot(estimate, truth=truth)

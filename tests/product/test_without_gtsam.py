"""Where GTSAM is not installed, as on Windows: the chain solves, and says so once."""

import subprocess
import sys

CODE = """
import sys
sys.modules["gtsam"] = None  # as where it is not installed
import msgspec, numpy as np
import fgnav
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

demo = msgspec.structs.replace(load_scenario("demo"), duration_s=6.0)
flight = simulate(demo, np.random.default_rng(1))
made = fgnav.compare(flight, [Smoother(), Batch(), Forward()])
for method in made.methods:
    assert method.score.attitude_rmse_deg < 1.0, method.score
    assert method.estimate.notes.count(
        "GTSAM is not installed: the compiled chain has solved the graph."
    ) == 1
from fgnav.evaluation.report.table import remarks
assert sum("GTSAM is not installed" in line for line in remarks(made)) == 1
try:
    Smoother(solver="gtsam")
except fgnav.BadInputError as error:
    print(error)
"""


def test_smoothers_are_solved_by_the_chain():
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    want = "smoother solver: gtsam is not installed (it has no wheel for Windows); solver chain "
    assert done.stdout.strip() == want + "does without it"

"""The heading network of ``notebooks/03_neural_factor``, made by its very lines.

No model of the library knows photodiodes. The network learns the heading from their currents, and
how well it knows it.
"""

from functools import cache
from pathlib import Path

import numpy as np

from fgnav.integers.resolvers.truth import attitude_at
from fgnav.neural.records import Record
from fgnav_models import learn

NOTEBOOK = Path(__file__).resolve().parents[2] / "notebooks" / "03_neural_factor.py"
NAME, SENSOR = "sun", "photodiodes"


@cache
def made():
    """Return what the notebook has made up to its flights, by name."""
    lines, flights = NOTEBOOK.read_text(encoding="utf-8").split("flown = ")
    assert flights
    names = {}
    exec(compile(lines, NOTEBOOK, "exec"), names)  # our own notebook
    return names


def written(folder, half_life_s=0.2):
    """Write the network and its manifest; return the manifest's path."""
    net, diodes = (made()[name] for name in ("net", "diodes"))
    errors = {"half_life_s": half_life_s}
    return learn.export(learn.factor(net, "heading", [diodes], name=NAME, **errors), folder)


def recorded(truth, seed):
    """Return what the diodes record on a flight."""
    notebook = made()
    t_s = np.arange(truth.t_s[0], truth.t_s[-1], 1 / notebook["RATE_HZ"])
    R_nb, covered = attitude_at(truth, t_s)
    values = notebook["currents"](R_nb[covered], np.random.default_rng(seed))
    return Record(t_s=t_s[covered], values=values, unit="A", frame="b")

"""The heading network of ``notebooks/03_neural_factor``, made by its very cells.

No model of the library knows photodiodes. The network learns the heading from their currents, and
how well it knows it: where the sun stands high over a banked body, badly.
"""

from functools import cache
from pathlib import Path

import msgspec
import numpy as np

from fgnav.integers.resolvers.truth import attitude_at
from fgnav.neural.manifest import read_manifest, save_manifest
from fgnav.neural.records import Record

NOTEBOOK = Path(__file__).resolve().parents[2] / "notebooks" / "03_neural_factor.py"
NAME, SENSOR = "sun compass", "photodiodes"


@cache
def made():
    """Return what the notebook has made up to its calibration, by name."""
    cells, rest = NOTEBOOK.read_text(encoding="utf-8").split("# ## Calibration\n")
    assert rest
    names = {}
    exec(compile(cells, NOTEBOOK, "exec"), names)  # our own notebook
    return names


def written(folder, half_life_s=0.07):
    """Write the network and its manifest; return the manifest's path."""
    source, path = made()["folder"], folder / "sun.json"
    (folder / "sun.onnx").write_bytes((source / "sun.onnx").read_bytes())
    manifest = read_manifest(source / "sun.json")
    output = msgspec.structs.replace(manifest.output, half_life_s=half_life_s)
    save_manifest(msgspec.structs.replace(manifest, output=output), path)
    return path


def recorded(truth, seed):
    """Return what the diodes record on a flight."""
    notebook = made()
    t_s = np.arange(truth.t_s[0], truth.t_s[-1], 1 / notebook["RATE_HZ"])
    R_nb, covered = attitude_at(truth, t_s)
    values = notebook["currents"](R_nb[covered], np.random.default_rng(seed))
    return Record(t_s=t_s[covered], values=values, unit="A", frame="b")

"""Networks as factors: an ONNX file and a manifest that says what it measures, in which unit.

Owns the contract of a learned measurement (``manifest``), the bounded run of its file (``network``,
``onnx``), the windows of samples it sees (``windows``), what its outputs say of the states
(``outputs``) or of an array's integers (``integers``), how outputs that err alike are counted
(``correlation``) and how honest they are (``calibration``). Nothing is unpickled; torch is not
needed.
"""

from typing import Any

_HOMES = {
    "calibration": "fgnav.neural.calibration",
    "Covariance": "fgnav.neural.manifest",
    "Input": "fgnav.neural.manifest",
    "Manifest": "fgnav.neural.manifest",
    "NeuralFactor": "fgnav.neural.factor",
    "Output": "fgnav.neural.manifest",
    "Record": "fgnav.neural.records",
    "read_manifest": "fgnav.neural.manifest",
    "factor_of": "fgnav.neural.outputs",
    "save_manifest": "fgnav.neural.manifest",
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a name when it is first used: a factor brings GTSAM."""
    from importlib import import_module  # noqa: PLC0415

    if name not in _HOMES:
        msg = f"module 'fgnav.neural' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(_HOMES[name]), name)

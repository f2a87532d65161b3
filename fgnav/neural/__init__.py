"""Networks as factors: an ONNX file and a manifest that says what it measures, in which unit.

Owns the contract of a learned measurement (``manifest``), the bounded run of its file (``network``,
``onnx``), the windows of samples it sees (``windows``), what its outputs say of the states
(``outputs``) or of an array's integers (``integers``), and how outputs that err alike are counted
(``correlation``). Nothing is unpickled; torch is not needed.
"""

from fgnav.lazy import lazy

__getattr__ = lazy(
    __name__,
    {
        "factor": ("NeuralFactor",),
        "manifest": ("Covariance", "Input", "Manifest", "Output", "read_manifest", "save_manifest"),
        "outputs": ("factor_of",),
        "records": ("Record",),
    },
)

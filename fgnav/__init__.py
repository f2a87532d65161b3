"""Attitude, position and velocity from recorded flights, with honest uncertainty.

Frames
------
``n`` North-East-Down, fixed at the flight's origin; ``b`` body, forward-right-down;
``e`` Earth-centred Earth-fixed (WGS-84); ``i`` inertial. A vector ends in its frame and unit:
``p_n_m``, ``v_n_mps``, ``f_b_mps2``. A rotation names target then source, ``v_n = R_nb @ v_b``.

Angles
------
3-2-1 Euler angles: yaw about z, pitch about the new y, roll about the new x. A tangent is a
rotation vector in body axes, ``R = R_hat @ Exp(delta_b_rad)``; poses put rotation first, as GTSAM.

Units and time
--------------
SI and radians; files and screens may use degrees, and then the name says so. ``t_s`` is GPS time in
seconds since the flight's ``start``.

Arrays
------
Item index first: ``(n, 3)`` vectors, ``(n, 3, 3)`` matrices, float64 and int64. A border type
copies, checks and freezes its arrays once; nothing inside validates again. NaN means "not measured"
where a docstring says so, and is an error everywhere else.
"""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fgnav.kernels.cache import ensure_kernel_cache

if TYPE_CHECKING:  # what an editor and a type checker see
    from fgnav import attitude, gnss, integers, methods
    from fgnav.checks import BadInputError, FgnavError, NoSolutionError
    from fgnav.evaluation.comparison import Comparison, compare
    from fgnav.io.exports.recorded import load_estimate, save_estimate
    from fgnav.io.flight.folder import load_flight, save_flight
    from fgnav.methods.smoother import Batch, Forward, Smoother
    from fgnav.methods.stream import Stream
    from fgnav.neural.factor import NeuralFactor
    from fgnav.types.estimate import Estimate
    from fgnav.types.flight import Flight

ensure_kernel_cache(Path(__file__).parent)  # before anything imports numba

__version__ = "0.1.0"

# The stable face of the library, loaded on first use so that ``import fgnav`` stays cheap.
_FACE = {
    "load_flight": "fgnav.io.flight.folder",
    "save_flight": "fgnav.io.flight.folder",
    "load_estimate": "fgnav.io.exports.recorded",
    "save_estimate": "fgnav.io.exports.recorded",
    "Flight": "fgnav.types.flight",
    "Estimate": "fgnav.types.estimate",
    "Smoother": "fgnav.methods.smoother",
    "Forward": "fgnav.methods.smoother",
    "Batch": "fgnav.methods.smoother",
    "Stream": "fgnav.methods.stream",
    "NeuralFactor": "fgnav.neural.factor",
    "compare": "fgnav.evaluation.comparison",
    "Comparison": "fgnav.evaluation.comparison",
    "FgnavError": "fgnav.checks",
    "BadInputError": "fgnav.checks",
    "NoSolutionError": "fgnav.checks",
}

_PACKAGES = ("attitude", "gnss", "integers", "methods")

__all__ = [
    "BadInputError",
    "Batch",
    "Comparison",
    "Estimate",
    "FgnavError",
    "Flight",
    "Forward",
    "NeuralFactor",
    "NoSolutionError",
    "Smoother",
    "Stream",
    "__version__",
    "attitude",
    "compare",
    "gnss",
    "integers",
    "load_estimate",
    "load_flight",
    "methods",
    "save_estimate",
    "save_flight",
]


def __dir__() -> list[str]:
    """Return the names of the face, which help and completion show."""
    return sorted(__all__)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a name of the library's face when it is first used."""
    if name in _PACKAGES:
        return import_module(f"fgnav.{name}")
    if name not in _FACE:
        msg = f"module 'fgnav' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(_FACE[name]), name)

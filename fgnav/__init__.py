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
    from fgnav import attitude as attitude
    from fgnav import gnss as gnss
    from fgnav import graph as graph
    from fgnav import integers as integers
    from fgnav import methods as methods
    from fgnav import neural as neural
    from fgnav.checks import BadInputError as BadInputError
    from fgnav.checks import FgnavError as FgnavError
    from fgnav.checks import NoSolutionError as NoSolutionError
    from fgnav.evaluation.comparison import Comparison as Comparison
    from fgnav.evaluation.flights import FlightsComparison as FlightsComparison
    from fgnav.face import compare as compare
    from fgnav.face import method as method
    from fgnav.face import plot as plot
    from fgnav.geometry.earth import Origin as Origin
    from fgnav.io.exports.recorded import load_estimate as load_estimate
    from fgnav.io.exports.recorded import save_estimate as save_estimate
    from fgnav.io.flight.folder import load_flight as load_flight
    from fgnav.io.flight.folder import save_flight as save_flight
    from fgnav.methods.smoother import Batch as Batch
    from fgnav.methods.smoother import Forward as Forward
    from fgnav.methods.smoother import Smoother as Smoother
    from fgnav.methods.stream import Stream as Stream
    from fgnav.neural.factor import NeuralFactor as NeuralFactor
    from fgnav.types.estimate import Estimate as Estimate
    from fgnav.types.flight import Antenna as Antenna
    from fgnav.types.flight import Baseline as Baseline
    from fgnav.types.flight import Fixes as Fixes
    from fgnav.types.flight import Flight as Flight
    from fgnav.types.flight import Imu as Imu
    from fgnav.types.flight import InitialAttitude as InitialAttitude
    from fgnav.types.flight import Photodetector as Photodetector
    from fgnav.types.flight import Truth as Truth
    from fgnav.types.observations import Observations as Observations
    from fgnav.types.surroundings import Barometer as Barometer
    from fgnav.types.surroundings import Magnetometer as Magnetometer
    from fgnav.types.vehicle import FinnedVehicle as FinnedVehicle
    from fgnav.types.vehicle import WheeledVehicle as WheeledVehicle

ensure_kernel_cache(Path(__file__).parent)  # before anything imports numba

__version__ = "0.1.0"

# The stable face of the library, loaded on first use so that ``import fgnav`` stays cheap.
_FACE = {
    "checks": ("BadInputError", "FgnavError", "NoSolutionError"),
    "evaluation.comparison": ("Comparison",),
    "evaluation.flights": ("FlightsComparison",),
    "face": ("compare", "method", "plot"),
    "geometry.earth": ("Origin",),
    "io.exports.recorded": ("load_estimate", "save_estimate"),
    "io.flight.folder": ("load_flight", "save_flight"),
    "methods.smoother": ("Batch", "Forward", "Smoother"),
    "methods.stream": ("Stream",),
    "neural.factor": ("NeuralFactor",),
    "types.estimate": ("Estimate",),
    "types.flight": (
        *("Antenna", "Baseline", "Fixes", "Flight", "Imu", "InitialAttitude"),
        *("Photodetector", "Truth"),
    ),
    "types.observations": ("Observations",),
    "types.surroundings": ("Barometer", "Magnetometer"),
    "types.vehicle": ("FinnedVehicle", "WheeledVehicle"),
}
_PACKAGES = ("attitude", "gnss", "graph", "integers", "methods", "neural")
_HOMES = {name: home for home, names in _FACE.items() for name in names}

__all__ = sorted([*_HOMES, *_PACKAGES, "__version__"])


def __dir__() -> list[str]:
    """Return the names of the face, which help and completion show."""
    return list(__all__)


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load a name of the library's face when it is first used."""
    if name in _PACKAGES:
        return import_module(f"fgnav.{name}")
    if name not in _HOMES:
        msg = f"module 'fgnav' has no attribute {name!r}"
        raise AttributeError(msg)
    return getattr(import_module(f"fgnav.{_HOMES[name]}"), name)

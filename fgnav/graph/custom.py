"""Custom factors: the door to GTSAM's ``CustomFactor`` that checks what it is handed.

GTSAM takes any matrix for a Jacobian. Of one with too few rows or columns it reads beyond the end:
the process dies, or the estimate is wrong without a word; NaN comes back as "indeterminate" or as
no step at all. So ``residual_factor`` checks every shape and value before GTSAM sees it.

A ``BadInputError`` of a factor passes through GTSAM 4.3.0 as it is, out of ``error``,
``linearize``, ISAM2, the fixed-lag smoother and Levenberg-Marquardt.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import gtsam
import numpy as np
from numpy.typing import ArrayLike

from fgnav.checks import BadInputError
from fgnav.graph import keys as symbols
from fgnav.graph.residual_model import Jacobian, Residual, ResidualModel, spelt

Noise: TypeAlias = ArrayLike | gtsam.noiseModel.Base


@dataclass(frozen=True, eq=False, slots=True)
class NamedFactor:
    """A factor of a graph with the name that reports call it by."""

    name: str
    factor: gtsam.NonlinearFactor  # what the graph is given
    # What it evaluates; None of a factor that ``residual_factor`` did not make.
    model: ResidualModel | None = None


def residual_factor(
    name: str,
    keys: Sequence[int],
    residual: Residual,
    noise: Noise,
    *,
    jacobian: Jacobian | None = None,
    dimension: int | None = None,
) -> NamedFactor:
    """Return a custom factor, whose every shape is checked before GTSAM sees it.

    Parameters
    ----------
    name : str
        What reports call it: ``"wheel speed"``.
    keys : sequence of int
        Variables, such as ``fgnav.graph.pose(k)``.
    residual : callable
        ``residual(*variables) -> (m,)`` of the variables as they are in ``gtsam.Values``:
        ``gtsam.Pose3``, arrays, ``gtsam.imuBias.ConstantBias``.
    noise : float, ndarray of shape (m,) or (m, m), or gtsam.noiseModel.Base
        1-sigma of all rows or of each, or their covariance.
    jacobian : callable, optional
        ``jacobian(*variables) -> (m, d_i) for each``, by tangents: of ``Pose3`` rotation and
        position in body axes. Central differences by default, at 2 d residuals each.
    dimension : int, optional
        m; needed where the noise is one number, else that of the noise.

    Returns
    -------
    NamedFactor

    Raises
    ------
    BadInputError
        If name, keys, noise or dimension are none.

    Examples
    --------
    A height that something says of the third keyframe:

    >>> from fgnav.graph import pose, residual_factor
    >>> factor = residual_factor("height", [pose(2)], lambda x: [-x.z() - 120.0], 0.5, dimension=1)
    >>> factor.name
    'height'
    """
    keys_of = tuple(int(key) for key in keys)
    if not name or not keys_of or len(set(keys_of)) < len(keys_of):
        raise BadInputError(f"factor {name!r}: needs a name and keys, each once, got {keys_of}")
    model = _noise_model(name, noise, dimension)
    rows = int(model.dim())
    if dimension is not None and dimension != rows:
        raise BadInputError(f"factor {name!r}: dimension is {dimension}, its noise has {rows}")
    checked = ResidualModel(
        name=name, keys=keys_of, residual=residual, jacobian=jacobian, rows=rows
    )
    return NamedFactor(name, gtsam.CustomFactor(model, list(keys_of), checked.error), checked)


def named(factor: NamedFactor | gtsam.NonlinearFactor) -> NamedFactor:
    """Return a factor with its name: a plain one of GTSAM is called by its class.

    GTSAM keeps no name with a factor; whoever adds it to a graph keeps this beside it.

    Raises
    ------
    BadInputError
        If it is no factor.
    """
    if isinstance(factor, NamedFactor):
        return factor
    if not isinstance(factor, gtsam.NonlinearFactor):
        raise BadInputError(
            f"factors: must be gtsam factors or residual_factor's, got {type(factor).__name__}"
        )
    return NamedFactor(type(factor).__name__, factor)


def touched_keyframes(factor: gtsam.NonlinearFactor) -> list[int]:
    """Return the numbers of the keyframes that a factor touches, increasing."""
    involved = list(factor.keys())
    return sorted({symbols.index(key) for key in involved if symbols.letter(key) in "xvbm"})


def check_factor(factor: NamedFactor, values: gtsam.Values) -> None:
    """Evaluate a factor once, Jacobians too, before GTSAM does.

    Raises
    ------
    BadInputError
        Naming the factor, the variable, and what is wrong with its shape or value.
    """
    if factor.model is not None:
        variables = factor.model.variables(values)
        factor.model.value(variables)
        factor.model.jacobians(variables)
        return
    for key in list(factor.factor.keys()):
        if not values.exists(key):
            raise BadInputError(f"factor {factor.name!r}: {spelt(key)} is not among the variables")
    try:
        error = factor.factor.error(values)
    except (RuntimeError, ValueError) as raised:
        text = " ".join(str(raised).split())
        raise BadInputError(f"factor {factor.name!r}: {text}") from raised
    if not np.isfinite(error):
        raise BadInputError(f"factor {factor.name!r}: its error is not finite")


def _noise_model(name: str, noise: Noise, dimension: int | None) -> gtsam.noiseModel.Base:
    if isinstance(noise, gtsam.noiseModel.Base):
        return noise
    given = np.array(noise, dtype=np.float64)
    if given.ndim == 0 and dimension is not None:
        given = np.full(dimension, given)
    if given.ndim == 1 and len(given) and (np.isfinite(given) & (given > 0)).all():
        return gtsam.noiseModel.Diagonal.Sigmas(given)
    if given.ndim == 2 and len(given) and np.allclose(given, given.T, rtol=1e-9, atol=0):
        values = np.linalg.eigvalsh(given)
        if np.isfinite(values).all() and values[0] > 0:
            return gtsam.noiseModel.Gaussian.Covariance(given)
    raise BadInputError(
        f"factor {name!r}: noise must be positive 1-sigmas (m,), a positive definite covariance "
        f"(m, m), one number with a dimension, or a gtsam noise model, got shape {given.shape}"
    )

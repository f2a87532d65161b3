"""A residual of a graph's variables and its Jacobians, evaluated with every shape checked."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, TypeAlias

import gtsam
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fgnav.checks import BadInputError, FloatArray
from fgnav.graph import keys as symbols

Variable: TypeAlias = Any  # as in gtsam.Values: Pose3, ConstantBias, ndarray
Residual: TypeAlias = Callable[..., ArrayLike]
Jacobian: TypeAlias = Callable[..., Sequence[ArrayLike]]

STEP = 1e-5  # of central differences, rad, m, m/s: about the cube root of rounding
_READERS = {"x": "atPose3", "b": "atConstantBias"}  # of ``gtsam.Values`` by letter; else atVector


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ResidualModel:
    """A residual of variables, and its Jacobians, evaluated with every shape checked."""

    name: str
    keys: tuple[int, ...]
    residual: Residual
    jacobian: Jacobian | None  # none: central differences along each variable's own tangent
    rows: int  # m, of the residual

    def variables(self, values: gtsam.Values) -> list[Variable]:
        """Return the factor's variables as they are in the values.

        Raises
        ------
        BadInputError
            If one is not among them.
        """
        variables = []
        for key in self.keys:
            if not values.exists(key):
                raise BadInputError(
                    f"factor {self.name!r}: {spelt(key)} is not among the variables"
                )
            read = getattr(values, _READERS.get(symbols.letter(key), "atVector"))
            variables.append(read(key))
        return variables

    def value(self, variables: Sequence[Variable]) -> NDArray[np.float64]:
        """Return the residual, (m,).

        Raises
        ------
        BadInputError
            If it raises, or is of another shape, or not finite.
        """
        try:
            value = np.array(self.residual(*variables), dtype=np.float64)
        except BadInputError:
            raise
        except Exception as error:
            raise self._failed("residual", error) from error
        self._check("residual", value, (self.rows,))
        return value

    def jacobians(self, variables: Sequence[Variable]) -> list[NDArray[np.float64]]:
        """Return the derivatives by each variable's tangent, (m, d_i).

        Raises
        ------
        BadInputError
            If one is of another shape, or not finite, or their number is not that of the keys.
        """
        if self.jacobian is None:
            return self.differences(variables)
        try:
            blocks = [np.array(block, dtype=np.float64) for block in self.jacobian(*variables)]
        except BadInputError:
            raise
        except Exception as error:
            raise self._failed("jacobian", error) from error
        if len(blocks) != len(self.keys):
            raise BadInputError(
                f"factor {self.name!r}: jacobian returned {len(blocks)} blocks, expected "
                f"{len(self.keys)}, one for each of {', '.join(map(spelt, self.keys))}"
            )
        for j, (variable, block) in enumerate(zip(variables, blocks, strict=True)):
            self._check("jacobian", block, (self.rows, _size(variable)), self.keys[j])
        return blocks

    def differences(self, variables: Sequence[Variable]) -> list[NDArray[np.float64]]:
        """Return the derivatives by central differences, (m, d_i)."""
        blocks = []
        for j, variable in enumerate(variables):
            d, moved = _size(variable), list(variables)
            block = np.empty((self.rows, d))
            for c, step in enumerate(STEP * np.eye(d)):
                moved[j] = _retracted(variable, step)
                ahead = self.value(moved)
                moved[j] = _retracted(variable, -step)
                block[:, c] = (ahead - self.value(moved)) / (2 * STEP)
            blocks.append(block)
        return blocks

    def error(
        self, _: gtsam.CustomFactor, values: gtsam.Values, H: list[FloatArray] | None
    ) -> NDArray[np.float64]:
        """Return the residual and set its Jacobians: GTSAM's error function."""
        variables = self.variables(values)
        value = self.value(variables)
        if H is not None:
            for j, block in enumerate(self.jacobians(variables)):
                H[j] = block
        return value

    def _check(
        self,
        what: str,
        array: NDArray[np.float64],
        shape: tuple[int, ...],
        by: int | None = None,
    ) -> None:
        # The sum of squares of what is not finite is not: a quarter of the time of asking each.
        if array.shape == shape and isfinite(np.vdot(array, array)):
            return
        keys = ", ".join(map(spelt, self.keys))
        what = what if by is None else f"{what} by {spelt(by)}"
        if array.shape != shape:
            raise BadInputError(
                f"factor {self.name!r} on {keys}: {what} has shape {array.shape}, expected {shape}"
            )
        raise BadInputError(f"factor {self.name!r} on {keys}: {what} is not finite")

    def _failed(self, what: str, error: Exception) -> BadInputError:
        text = " ".join(str(error).split())
        keys = ", ".join(map(spelt, self.keys))
        return BadInputError(
            f"factor {self.name!r} on {keys}: {what} raised {type(error).__name__}: {text}"
        )


def spelt(key: int) -> str:
    """Return a key as it is read: ``x3``."""
    return f"{symbols.letter(key)}{symbols.index(key)}" if key >> 56 else str(key)


def _size(variable: Variable) -> int:
    """Return the dimensions of a variable's tangent: ConstantBias has no ``dim``."""
    return len(variable) if isinstance(variable, np.ndarray) else 6


def _retracted(variable: Variable, step: FloatArray) -> Variable:
    """Return a variable a step along its tangent away."""
    return variable + step if isinstance(variable, np.ndarray) else variable.retract(step)

"""The integers of double-differenced carrier phase: resolvers and the searches behind them."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # what an editor and a type checker see
    from fgnav.integers.ils.search import integer_least_squares

__all__ = ["integer_least_squares"]


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Load the search when it is first used: it brings numba."""
    if name == "integer_least_squares":
        from fgnav.integers.ils.search import integer_least_squares  # noqa: PLC0415  # lazy

        return integer_least_squares
    msg = f"module 'fgnav.integers' has no attribute {name!r}"
    raise AttributeError(msg)

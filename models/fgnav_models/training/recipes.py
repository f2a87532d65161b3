"""Recipes: one table of plain content, changed by the scale, then checked as a whole."""

from collections.abc import Mapping
from typing import Any, TypeVar

from fgnav.checks import BadInputError
from fgnav.io.strict_toml import as_table
from fgnav_models.training.order import Order

T = TypeVar("T")


def scaled(order: Order, table: type[T]) -> T:
    """Return the recipe of an order at its scale: ``[scale.NAME]`` is laid over the rest.

    Raises
    ------
    BadInputError
        If the recipe does not know the scale, or a key or value is wrong.
    """
    return as_table(order.recipe, plain(order), table)


def plain(order: Order) -> dict[str, Any]:
    """Return the plain content of a recipe at its scale; errors as ``scaled``."""
    content = dict(order.content)
    scales = content.pop("scale", {})
    if not isinstance(scales, Mapping) or order.scale not in scales:
        raise BadInputError(f"{order.recipe}: key scale: has no table for --scale {order.scale}")
    return laid_over(content, scales[order.scale])


def laid_over(content: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain content with changes laid over it, table by table."""
    result = dict(content)
    for key, value in changes.items():
        below = result.get(key)
        both = isinstance(below, Mapping) and isinstance(value, Mapping)
        result[key] = laid_over(below, value) if both else value  # type: ignore[arg-type]
    return result

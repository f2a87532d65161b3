"""Recipes: one table of plain content, changed by the scale, then checked as a whole."""

from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

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


def said(part: object) -> Any:  # noqa: ANN401  # plain content of any part
    """Return a part of a recipe as plain content, without what it would be unsaid."""
    if isinstance(part, msgspec.Struct):
        config = part.__struct_config__
        kind = {config.tag_field: config.tag} if config.tag is not None else {}
        return kind | {
            field.encode_name: said(value)
            for field in msgspec.structs.fields(part)
            if (value := getattr(part, field.name)) != _unsaid(field)
        }
    if isinstance(part, Mapping):
        return {key: said(value) for key, value in part.items()}
    if isinstance(part, list | tuple):
        return [said(value) for value in part]
    return msgspec.to_builtins(part)


def _unsaid(field: msgspec.structs.FieldInfo) -> object:
    """Return the default of a field."""
    made = field.default_factory
    return field.default if made is msgspec.NODEFAULT else made()

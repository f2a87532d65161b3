"""Integers of an array by a network: each with a probability, or candidates' posterior."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray
from fgnav.neural.network import Network

_WHOLE = 1e-6  # integers come as they are; this is of floats that hold them


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class IntegerAnswers:
    """Of k epochs, or candidates."""

    value: FloatArray  # (k, t); integers; of the form ``posterior`` exponents of candidates, t = 1
    # (k, t), or None; probabilities of integers to be right; exponents of no candidate to be. None
    # of the form ``none``.
    sure: FloatArray | None
    within: BoolArray  # (k,); whether all inputs are as in training


def integer_answers(network: Network, inputs: Sequence[FloatArray]) -> IntegerAnswers:
    """Run a network on inputs, (k, window, channels) each, of one row or more.

    Raises
    ------
    BadInputError
        If an input is of another shape, or an output is not finite, no integer, no probability, or
        of another width.
    """
    manifest, lengths = network.manifest, {len(x) for x in inputs}
    for index, (spec, x) in enumerate(zip(manifest.inputs, inputs, strict=True)):
        shape = (spec.window, len(spec.range))
        if x.shape[1:] != shape or len(lengths) > 1:
            raise BadInputError(
                f"{network.path}: key inputs[{index}]: {spec.name!r} takes rows of shape {shape}, "
                f"got {x.shape}"
            )
    raw, form = network.run(inputs), manifest.output.covariance.form
    named: dict[str, FloatArray] = {
        key: output for (key, _), output in zip(manifest.outputs(), raw, strict=True)
    }
    for key, output in named.items():
        if not np.isfinite(output).all():
            raise BadInputError(f"{network.path}: {key}: not finite")
    value = named["output.name"]
    sure = named.get("output.covariance.name")
    if form != "posterior" and np.abs(value - np.round(value)).max() > _WHOLE:
        raise BadInputError(f"{network.path}: output.name: must be integers, by manifold Z")
    if form == "probability" and sure is not None and not ((sure >= 0) & (sure <= 1)).all():
        raise BadInputError(f"{network.path}: output.covariance.name: must be probabilities")
    if sure is not None and sure.shape[1] != value.shape[1]:
        raise BadInputError(
            f"{network.path}: output.covariance.name: must have {value.shape[1]} numbers, has "
            f"{sure.shape[1]}"
        )
    inside = [spec.inside(x).all(axis=1) for spec, x in zip(manifest.inputs, inputs, strict=True)]
    return IntegerAnswers(value=value, sure=sure, within=np.logical_and.reduce(inside))

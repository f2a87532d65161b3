"""An ambiguity network as it is released: features in, integers out."""

from dataclasses import replace
from typing import Any

import msgspec
import torch
from torch import nn

from fgnav.checks import FloatArray
from fgnav.neural.manifest import Covariance, Manifest
from fgnav_models.runtime.ambiguity import GIVEN
from fgnav_models.training.ambiguity.nets import N_MAX, AmbiguityNet, cycles_of
from fgnav_models.training.contract import (
    Release,
    epoch_input,
    integers_output,
    manifest_of,
    words_and_figures,
)
from fgnav_models.training.order import Order
from fgnav_models.training.release import made_with, release

_SENSOR = "double differences"
_NOTHING = Covariance(form="none")


class Answer(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A network with its answer in words of the field: integers, and how sure or how far.

    Classification returns the probability of the integer; regression the real number of cycles.
    """

    def __init__(self, net: AmbiguityNet) -> None:
        super().__init__()
        self.net = net

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return integers, (n, t) int64, and probability or cycles, (n, t), of (n, k, f)."""
        answer = self.net(features)
        cycles = cycles_of(self.net.task, answer)
        if self.net.task == "classification":
            return cycles, torch.softmax(answer, dim=-1).amax(dim=-1).float()
        return cycles, (answer * (2 * N_MAX) - N_MAX).float()


def release_network(
    net: AmbiguityNet,
    example: FloatArray,
    words: Release,
    recipe: dict[str, Any],
    metrics: dict[str, float],
    order: Order,
) -> Manifest:
    """Write a network's ONNX file, manifest and card, float16 inside.

    Parameters
    ----------
    net : AmbiguityNet
        Trained, on the CPU.
    example : ndarray, shape (n, f)
        Features to compare torch and onnxruntime on.
    """
    # Of features another than the released ones are: whatever their number.
    sensor = replace(GIVEN[_SENSOR], channels=example.shape[1])
    classifies = net.task == "classification"
    form = Covariance(form="probability", name="probability") if classifies else _NOTHING
    card_words, figures = words_and_figures(words.domain)
    manifest = manifest_of(
        words,
        (epoch_input("features", _SENSOR, sensor, net.window),),
        integers_output("cycles", form),
        figures,
        made_with(int(recipe["seed"]), recipe, metrics, order),
    )
    words = msgspec.structs.replace(words, domain=card_words)
    windows = example[:, None].repeat(net.window, axis=1)
    return release(Answer(net), [windows], manifest, words, metrics, order.out, half=True)

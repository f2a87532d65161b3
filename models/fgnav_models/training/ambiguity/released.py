"""An ambiguity network as it is released: features in, integers out."""

import platform
from pathlib import Path
from typing import Any

import torch
from torch import nn

from fgnav.checks import FloatArray
from fgnav.io.strict_toml import Table
from fgnav_models.runtime.manifest import Manifest, Port
from fgnav_models.training.ambiguity.nets import N_MAX, AmbiguityNet, cycles_of
from fgnav_models.training.release import Story, release


class Release(Table, frozen=True):
    """What a recipe says about a network to be released.

    Attributes
    ----------
    name, purpose : str
    notes : dict of str to str
        Sections of the model card, in Markdown.
    domain : dict
        Where the network may be believed.
    """

    name: str
    purpose: str
    notes: dict[str, str]
    domain: dict[str, Any]


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
    folder: Path,
) -> Manifest:
    """Write a network's ONNX file, manifest and card, float16 inside.

    Parameters
    ----------
    net : AmbiguityNet
        Trained, on the CPU.
    example : ndarray, shape (n, f)
        Features to compare torch and onnxruntime on.
    words : Release
    recipe : dict
    metrics : dict of str to float
    folder : Path
    """
    classifies = net.task == "classification"
    second = Port(
        name="probability" if classifies else "value",
        shape=("n", net.targets),
        unit="1" if classifies else "cycle",
        meaning="of the integer, by the network" if classifies else "what was rounded",
    )
    story = Story(
        name=words.name,
        purpose=words.purpose,
        inputs=(
            Port(
                name="features",
                shape=("n", net.window, example.shape[1]),
                unit="cycle",
                meaning="rows of fgnav_models.features.ambiguity_inputs, oldest first",
            ),
        ),
        outputs=(
            Port(
                name="cycles",
                shape=("n", net.targets),
                unit="cycle",
                dtype="int64",
                meaning="integer of each wrapped double difference, round(range / wavelength)",
            ),
            second,
        ),
        domain=words.domain,
        recipe=recipe,
        seed=int(recipe["seed"]),
        metrics=metrics,
        made_with={"hardware": f"CPU {platform.machine()}"},
    )
    windows = example[:, None].repeat(net.window, axis=1)
    return release(Answer(net), [windows], story, folder, notes=words.notes, half=True)

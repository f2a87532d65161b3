"""What recipes of networks that measure have in common: how one learns, and what it is told of."""

from collections.abc import Mapping
from typing import Annotated

import msgspec
import numpy as np

from fgnav.checks import FloatArray
from fgnav.io.strict_toml import Positive, Table
from fgnav.neural.manifest import FORMAT, Input, Manifest, Output, Statistic
from fgnav_models.training.ambiguity.released import Release
from fgnav_models.training.train import Settings

Count = Annotated[int, msgspec.Meta(ge=1)]
_VALIDATIONS = 10


class Steps(Table, frozen=True):
    """How long and how fast a network learns.

    Attributes
    ----------
    steps, batch : int
    learning_rate : float
    """

    steps: Count = 8000
    batch: Count = 1024
    learning_rate: Positive = 2e-3

    def settings(self, seed: int, validations: int = _VALIDATIONS) -> Settings:
        """Return what ``train`` takes, validated so many times."""
        return Settings(
            steps=self.steps,
            learning_rate=self.learning_rate,
            clip_norm=1.0,
            seed=seed,
            validate_every=max(1, self.steps // validations),
        )


class Learning(Steps, frozen=True):
    """How a network is made.

    Attributes
    ----------
    width : int
        Of its hidden layers.
    domain_percent : float
        Of the training windows that lie beyond each bound of the declared domain.
    """

    width: Count = 128
    domain_percent: Positive = 0.02

    def domain(
        self,
        units: Mapping[str, str],
        figures: Mapping[str, FloatArray],
        calm: tuple[str, ...] = (),
    ) -> tuple[Statistic, ...]:
        """Return what figures span over the training windows, but for a few.

        Parameters
        ----------
        units : mapping of str to str
            By the figure's name.
        figures : mapping of str to ndarray, shape (n,)
        calm : tuple of str
            Figures that may be as low as 0.
        """
        edges, out = (self.domain_percent, 100.0 - self.domain_percent), []
        for name, values in figures.items():
            low, high = (float(f"{x:.4g}") for x in np.percentile(values, edges))
            span = (0.0 if name in calm else low, high)
            out.append(Statistic(name=name, unit=units[name], range=span))
        return tuple(out)


def manifest_of(
    words: Release, inputs: tuple[Input, ...], output: Output, domain: tuple[Statistic, ...]
) -> Manifest:
    """Return the manifest of a network to be released, but for its file's hash."""
    return Manifest(
        format=FORMAT,
        name=words.name,
        purpose=words.purpose,
        onnx=f"{words.name}.onnx",
        sha256="0" * 64,
        licence="BSD-3-Clause",
        inputs=inputs,
        output=output,
        domain=domain,
    )

"""Learning, and the domain, of networks that measure: the common part of their recipes."""

from collections.abc import Mapping

import numpy as np
import torch

from fgnav.checks import FloatArray
from fgnav.io.strict_toml import NotNegative, Positive, Table
from fgnav.neural.manifest import Statistic
from fgnav_models.training.order import Order
from fgnav_models.training.train import Batch, Batches, Settings, Unused
from fgnav_sim.ranges import Count

_VALIDATIONS = 10


class Learning(Table, frozen=True):
    """Learning of a network: steps, batch and rate."""

    steps: Count = 8000
    batch: Count = 1024
    learning_rate: Positive = 2e-3
    weight_decay: NotNegative = 0.0
    width: Count = 128  # of its hidden layers
    # of the training windows that lie beyond each bound of the declared domain
    domain_percent: Positive = 0.02

    def train(
        self, order: Order, name: str, net: torch.nn.Module, batches: Batches, loss: Unused,
        held: Batch, seed: int,
    ) -> None:  # fmt: skip
        """Train a network on the order's device, validated on held-out rows; it ends on the CPU.

        Raises
        ------
        SliceOver
            If the time was up before the end.
        """
        settings = Settings(
            steps=self.steps,
            learning_rate=self.learning_rate,
            weight_decay=self.weight_decay,
            clip_norm=1.0,
            seed=seed,
            validate_every=max(1, self.steps // _VALIDATIONS),
        )

        def validated(module: torch.nn.Module) -> dict[str, float]:
            with torch.no_grad():
                return {"negative_log_likelihood": float(loss(module, held))}

        order.train(name, net, batches, loss, settings, validated)
        net.cpu()

    def domain(
        self,
        units: Mapping[str, str],
        figures: Mapping[str, FloatArray],
        calm: tuple[str, ...] = (),
    ) -> tuple[Statistic, ...]:
        """Return the range of figures over the training windows, but for a few.

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

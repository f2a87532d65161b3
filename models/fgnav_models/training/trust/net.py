"""The network that ranks integer candidates, and what it learns by."""

import torch
from torch import nn

from fgnav_models.trust_features import FEATURES, POSTERIOR

_LEAST = 1e-30  # share of a weight that is lost in rounding
_NONE = -9.0  # exponent of no candidate to be right, before anything is learned


class TrustNet(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """One judge for all candidates; the mixture's log posterior is added as it is.

    With the last layer at zero that is the answer.
    """

    def __init__(self, width: int, *, seed: int) -> None:
        super().__init__()
        generator = torch.random.fork_rng(devices=[])
        with generator:
            torch.manual_seed(seed)
            layers = [nn.Linear(FEATURES, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU()]
            self.judge = nn.Sequential(*layers, nn.Linear(width, width), nn.SiLU())
            self.answer = nn.Linear(width, 2)
            nn.init.zeros_(self.answer.weight)
            nn.init.zeros_(self.answer.bias)
        self.register_buffer("mean", torch.zeros(FEATURES))
        self.register_buffer("scale", torch.ones(FEATURES))
        self.register_buffer("cold", torch.ones(()))

    def normalize(self, features: torch.Tensor) -> None:
        """Take means and standard deviations of the inputs from a sample."""
        self.mean.copy_(features.mean(dim=0))
        self.scale.copy_(1.0 / features.std(dim=0).clamp(min=0.1))

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return score and score of none, (c,)."""
        answer = self.answer(self.judge((features - self.mean) * self.scale))
        score = answer[:, 0] + features[:, POSTERIOR]
        return score * self.cold, (answer[:, 1] + _NONE) * self.cold


def loss_of(module: nn.Module, batch: tuple[torch.Tensor, ...]) -> torch.Tensor:
    """Return minus the mean log posterior of epochs' right candidates, of none where none is."""
    features, epoch, first, right = batch
    score, none = module(features)
    with_none = torch.cat([score, none[first]]).double()
    of = torch.cat([epoch, torch.arange(len(first))])
    largest = torch.full((len(first),), -torch.inf, dtype=torch.float64)
    largest = largest.scatter_reduce(0, of, with_none.detach(), "amax")
    weight = torch.exp(with_none - largest[of])
    nothing = ~torch.zeros(len(first), dtype=torch.bool).index_put((epoch[right],), right[right])
    true = torch.cat([right, nothing])
    total, share = (torch.zeros(len(first), dtype=torch.float64) for _ in range(2))
    total = total.index_add(0, of, weight)
    share = share.index_add(0, of[true], weight[true])
    return (torch.log(total) - torch.log(share.clamp(min=_LEAST))).mean()

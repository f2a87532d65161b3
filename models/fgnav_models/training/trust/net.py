"""The network that ranks integer candidates, and what it learns by."""

import torch
from torch import nn

from fgnav_models.trust_features import LINK_FEATURES, WHOLE_FEATURES

_POOL = 1.0 / 16.0  # brings a sum over links to the size of one
_OUTLIER_SHARE = 0.3  # of the loss of links in that of an epoch
_LEAST = 1e-6  # probability of a link to be worse, or to be as stated


class TrustNet(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A deep set: links embedded alike, pooled by sum and maximum, then judged with the whole.

    What ``fgnav_models.trust_fit`` makes of candidates and links is added as it is: with all else
    at zero it is the answer.
    """

    def __init__(self, width: int, *, seed: int) -> None:
        super().__init__()
        generator = torch.random.fork_rng(devices=[])
        with generator:
            torch.manual_seed(seed)
            self.embed = nn.Sequential(
                nn.Linear(LINK_FEATURES, width), nn.SiLU(), nn.Linear(width, width), nn.SiLU()
            )
            self.judge = nn.Sequential(
                nn.Linear(2 * width + WHOLE_FEATURES, 2 * width),
                nn.SiLU(),
                nn.Linear(2 * width, width),
                nn.SiLU(),
            )
            self.answer = nn.Linear(width, 2)
            self.of_link, self.of_whole = nn.Linear(width, 16), nn.Linear(width, 16)
            self.outlier = nn.Linear(16, 1)
            nn.init.zeros_(self.answer.weight)
            nn.init.zeros_(self.outlier.weight)
        self.register_buffer("link_mean", torch.zeros(LINK_FEATURES))
        self.register_buffer("link_scale", torch.ones(LINK_FEATURES))
        self.register_buffer("whole_mean", torch.zeros(WHOLE_FEATURES))
        self.register_buffer("whole_scale", torch.ones(WHOLE_FEATURES))
        self.register_buffer("cold", torch.ones(()))

    def scale(self, links: torch.Tensor, is_present: torch.Tensor, whole: torch.Tensor) -> None:
        """Take means and standard deviations of the inputs from a sample."""
        own = links[is_present > 0]
        for name, value in (("link", own), ("whole", whole)):
            getattr(self, f"{name}_mean").copy_(value.mean(dim=0))
            getattr(self, f"{name}_scale").copy_(1.0 / value.std(dim=0).clamp(min=0.1))

    def forward(
        self, links: torch.Tensor, is_present: torch.Tensor, whole: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return score and score of none, (c,), and logits of outliers, (c, l)."""
        x = self.embed((links - self.link_mean) * self.link_scale)
        kept = x * is_present[:, :, None]
        pooled = [kept.sum(dim=1) * _POOL, kept.amax(dim=1)]
        figures = (whole - self.whole_mean) * self.whole_scale
        h = self.judge(torch.cat([*pooled, figures], dim=1))
        answer = self.answer(h)
        together = torch.tanh(self.of_link(x) + self.of_whole(h)[:, None, :])
        worse = links[:, :, LINK_FEATURES - 1].clamp(_LEAST, 1.0 - _LEAST)
        bad = self.outlier(together)[:, :, 0] + torch.log(worse) - torch.log(1.0 - worse)
        score = answer[:, 0] + whole[:, 0]
        return score * self.cold, (answer[:, 1] - 6.0) * self.cold, bad


def log_probabilities(
    score: torch.Tensor, none: torch.Tensor, epoch: torch.Tensor, first: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return log posteriors of candidates, (c,), and of none of them, (n,)."""
    n = len(first)
    none = none[first]
    largest = none.detach().clone().scatter_reduce(0, epoch, score.detach(), "amax")
    total = torch.exp(none - largest).index_add(0, epoch, torch.exp(score - largest[epoch]))
    total = largest + torch.log(total)
    return score - total[epoch], none - total[:n]


def loss_of(module: nn.Module, batch: tuple[torch.Tensor, ...]) -> torch.Tensor:
    """Return the cross-entropy of epochs, with that of the true candidates' links."""
    links, is_present, whole, outlier, epoch, first, true_row = batch
    score, none, bad = module(links, is_present, whole)
    rows, nones = log_probabilities(score, none, epoch, first)
    known = true_row >= 0
    chosen = true_row.clamp(min=0)
    entropy = -torch.where(known, rows[chosen], nones).mean()
    at = true_row[known]
    own = nn.functional.binary_cross_entropy_with_logits(bad[at], outlier[at], reduction="none")
    of_links: torch.Tensor = (own * is_present[at]).sum() / is_present[at].sum().clamp(min=1.0)
    return entropy + _OUTLIER_SHARE * of_links

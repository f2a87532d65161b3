"""What ``fgnav train`` asks of whoever trains: where to, how large, on what, until when."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

from fgnav_models.training.train import Progress

Scale: TypeAlias = Literal["smoke", "cpu", "paper"]
Device: TypeAlias = Literal["cpu", "cuda"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One call of the command."""

    recipe: Path  # the recipe's file; what it names is relative to its folder
    content: dict[str, Any]  # what the file holds, without the key ``kind``
    out: Path  # folder of checkpoints and results; exists
    scale: Scale
    device: Device
    deadline_s: float  # reading of ``time.perf_counter`` at which to stop with a checkpoint
    watch: Callable[[str, Progress], None]  # to be told what is trained and how it stands
    plan: bool = False  # a few steps of each network in the place of all


class Trainer(Protocol):
    """What a kind of recipe is run by."""

    def __call__(self, order: Order) -> list[str] | None:
        """Train until done or the deadline.

        Returns the lines to print at the end, or None where the time was up: the next call, with
        the same folder, goes on from there.
        """
        ...

"""What ``fgnav train`` asks of whoever trains: where to, how large, on what, until when."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

from fgnav_models.training.train import Progress

Scale: TypeAlias = Literal["smoke", "cpu", "paper"]
Device: TypeAlias = Literal["cpu", "cuda"]
By: TypeAlias = Literal["alone", "smoother"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """One call of the command.

    Attributes
    ----------
    recipe : Path
        The recipe's file; what it names is relative to its folder.
    content : dict
        What the file holds, without the key ``kind``.
    out : Path
        Folder of checkpoints and results; exists.
    deadline_s : float
        Reading of ``time.perf_counter`` at which to stop with a checkpoint.
    through : str
        ``"smoother"``: networks are trained on by what a smoother makes of them.
    watch : callable
        To be told what is trained and how it stands.
    """

    recipe: Path
    content: dict[str, Any]
    out: Path
    scale: Scale
    device: Device
    deadline_s: float
    watch: Callable[[str, Progress], None]
    through: By = "alone"


class Trainer(Protocol):
    """What a kind of recipe is run by."""

    def __call__(self, order: Order) -> list[str] | None:
        """Train until done or the deadline.

        Returns the lines to print at the end, or None where the time was up: the next call, with
        the same folder, goes on from there.
        """
        ...

"""Order of ``fgnav train`` to a trainer: folder, scale, device and time limit."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

import torch

from fgnav.io.atomic_write import made_folder, write_text
from fgnav_models.training.train import (
    Batches,
    Progress,
    Settings,
    Trained,
    Unused,
    Validate,
    train,
)

Scale: TypeAlias = Literal["smoke", "cpu", "paper"]
Device: TypeAlias = Literal["cpu", "cuda"]


class SliceOver(Exception):  # noqa: N818  # no error: the next slice goes on
    """The time is up; a checkpoint says where to go on."""


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

    def train(
        self,
        name: str,
        module: torch.nn.Module,
        batches: Batches,
        loss: Unused,
        settings: Settings,
        validate: Validate | None = None,
    ) -> Trained:
        """Train a module, or go on, with its checkpoint in the folder of a name.

        Raises
        ------
        SliceOver
            If the time was up before the end.
        """
        trained = train(
            module,
            batches,
            loss,
            settings,
            made_folder(self.out / name) / "checkpoint.safetensors",
            validate=validate,
            deadline_s=self.deadline_s,
            watch=lambda progress: self.watch(name, progress),
        )
        if not trained.finished:
            raise SliceOver
        return trained

    def report(
        self, heads: Sequence[str], rows: Sequence[Sequence[str]], words: str = ""
    ) -> list[str]:
        """Write words and a table into ``report.md``; return the lines to print."""
        path = self.out / "report.md"
        write_text(path, f"{words}{markdown_table(heads, rows)}\n")
        return [*(" | ".join(record) for record in rows), f"the table is in {path}"]


class Trainer(Protocol):
    """Trainer of a kind of recipe."""

    def __call__(self, order: Order) -> list[str]:
        """Train until done; return the lines to print at the end.

        Raises
        ------
        SliceOver
            If the time was up: the next call, with the same folder, goes on from there.
        """
        ...


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)

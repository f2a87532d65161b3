"""The command ``fgnav train``; everything heavy is imported when it runs."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from fgnav_models.training.train import Progress

# By the key `kind` of a recipe; each is a `fgnav_models.training.order.Trainer`.
_TRAINERS: Mapping[str, str] = {
    "ambiguity": "fgnav_models.training.ambiguity.report:run",
    "ambiguity-frame": "fgnav_models.training.ambiguity.frame:run",
    "gravity": "fgnav_models.training.gravity.trainer:run",
    "trust": "fgnav_models.training.trust.trainer:run",
    "velocity": "fgnav_models.training.velocity.trainer:run",
}
_LOG_S = 10.0  # between lines of train.log


def train(
    recipe: Path,
    /,
    *,
    out: Path,
    scale: Literal["smoke", "cpu", "paper"] = "cpu",
    device: Literal["cpu", "cuda"] = "cpu",
    resume: bool = False,
    slice_s: float = 480.0,
    plan: bool = False,
) -> None:
    """Train networks from a recipe.

    Writes checkpoints, results and a log into a folder. What is not done within the slice, or was
    killed, goes on with --resume where it stood. `fgnav recipes` lists those that come along.

    Example: fgnav train phases --scale smoke --out /tmp/phases

    Parameters
    ----------
    recipe : Path
        What to train: a TOML file, or the name of a recipe that comes along.
    out : Path
        Folder for checkpoints and results; a new or an empty one without --resume.
    scale : str
        smoke (seconds), cpu (an hour on two cores) or paper (days without a GPU).
    device : str
        cpu, or cuda for one NVIDIA GPU.
    resume : bool
        Go on with what the folder holds.
    slice_s : float
        Seconds after which to stop with a checkpoint.
    plan : bool
        Take two steps of each network in the place of all, and print what all would cost; what is
        written is good for nothing else.
    """
    from math import inf  # noqa: PLC0415
    from time import perf_counter  # noqa: PLC0415  # lazy, like all below

    from fgnav.checks import BadInputError, positive  # noqa: PLC0415
    from fgnav.io.atomic_write import made_folder  # noqa: PLC0415
    from fgnav.io.strict_toml import read_toml  # noqa: PLC0415
    from fgnav.shipped import file_or_shipped  # noqa: PLC0415

    positive("--slice-s", slice_s)
    if not resume and out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInputError(
            f"--out: must be a new or an empty folder, got '{out}'; --resume goes on with it"
        )
    recipe = file_or_shipped(recipe, "fgnav_models", "recipes")
    content = read_toml(recipe)
    kind = content.pop("kind", None)
    trainer = _trainer(recipe, kind, device)
    from fgnav_models.training.order import Order, SliceOver  # noqa: PLC0415  # torch: seconds
    from fgnav_models.training.plan import cost_lines, planned  # noqa: PLC0415

    start_s = perf_counter()
    with (
        _watched(made_folder(out) / "train.log") as watch,
        planned() if plan else nullcontext() as costs,
    ):
        order = Order(
            recipe=recipe,
            content=content,
            out=out,
            scale=scale,
            device=device,
            deadline_s=inf if plan else perf_counter() + slice_s,
            watch=watch,
            plan=plan,
        )
        try:
            lines = trainer(order)
        except SliceOver:
            lines = [f"not done after {slice_s:g} s: the same command with --resume goes on"]
    if costs is not None:
        lines = cost_lines(costs, device, perf_counter() - start_s)
    print("\n".join(lines))  # noqa: T201


def _trainer(recipe: Path, kind: object, device: str) -> "Callable[..., list[str]]":
    """Return the trainer of a kind of recipe, once torch and the device are known to be there."""
    from importlib import import_module  # noqa: PLC0415
    from importlib.util import find_spec  # noqa: PLC0415

    from fgnav.checks import BadInputError  # noqa: PLC0415

    if kind not in _TRAINERS:
        raise BadInputError(
            f"{recipe}: key kind must be one of {', '.join(_TRAINERS)}, got {kind!r}"
        )
    if find_spec("torch") is None:
        raise BadInputError("training needs torch; pip install 'fgnav[train]'")
    module, _, name = _TRAINERS[str(kind)].partition(":")
    import torch  # noqa: PLC0415

    if device == "cuda" and not torch.cuda.is_available():
        raise BadInputError("--device cuda: torch sees no NVIDIA GPU; --device cpu works anywhere")
    trainer: Callable[..., list[str]] = getattr(import_module(module), name)
    return trainer


@contextmanager
def _watched(log: Path) -> "Iterator[Callable[[str, Progress], None]]":
    """Show how training stands: on a terminal, and now and then as a line of the log."""
    from time import perf_counter  # noqa: PLC0415

    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, TextColumn  # noqa: PLC0415
    from rich.progress import Progress as Bars  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"))
    logged_s = -_LOG_S
    with (
        Bars(*columns, console=console, disable=not console.is_terminal, transient=True) as bars,
        log.open("a", encoding="utf-8") as file,
    ):
        task = bars.add_task("training", total=1.0, state="")

        def watch(what: str, now: "Progress") -> None:
            nonlocal logged_s
            state = f"{now.step}/{now.steps} loss {now.loss:.4g} ETA {_clock(now.eta_s)}"
            figures = " ".join(f"{k} {v:.4g}" for k, v in now.figures.items() if k != "step")
            bars.update(task, description=what, completed=now.step / now.steps, state=state)
            if now.step == now.steps or perf_counter() - logged_s >= _LOG_S:
                logged_s = perf_counter()
                file.write(f"{what}: step {state} {figures}".rstrip() + "\n")
                file.flush()

        yield watch


def _clock(seconds: float) -> str:
    """Return a duration as h:mm:ss."""
    total = round(seconds)
    return f"{total // 3600}:{total // 60 % 60:02d}:{total % 60:02d}"

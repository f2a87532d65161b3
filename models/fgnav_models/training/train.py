"""One loop for every network: steps that know their own random numbers, and can be cut anywhere.

Batch, dropout and learning rate of a step are functions of the seed and the step's number alone. A
checkpoint therefore holds weights, moments and a number, and a run that was killed continues on the
CPU to the very same bytes.
"""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal, Protocol, TypeAlias

import msgspec
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.io.atomic_write import atomic_file
from fgnav.io.strict_toml import NotNegative, Positive, Table
from fgnav_models.training.plan import Cost, costs_of_plan

Batch: TypeAlias = tuple[torch.Tensor, ...]
Unused: TypeAlias = Callable[[torch.nn.Module, Batch], torch.Tensor]
Validate: TypeAlias = Callable[[torch.nn.Module], Mapping[str, float]]

_SPREAD = 1_000_003  # prime; keeps the seeds of neighbouring runs' steps apart


class Batches(Protocol):
    """Batches: the batch of any step, on the training device."""

    def __call__(self, step: int) -> Batch:
        """Return the batch of a step; the same step gives the same batch."""
        ...


class Settings(Table, frozen=True):
    """Settings of a training."""

    steps: Annotated[int, msgspec.Meta(ge=1)]
    learning_rate: Positive = 1e-3  # at the start; ``cosine`` takes it to zero at the last step
    weight_decay: NotNegative = 0.0
    schedule: Literal["constant", "cosine"] = "cosine"
    clip_norm: Positive | None = None
    seed: int = 0
    # steps between validations; 0 for one at the end
    validate_every: Annotated[int, msgspec.Meta(ge=0)] = 0
    # ``"best"`` by the first figure that validation returns (the lower, the better), or ``"last"``
    keep: Literal["best", "last"] = "best"
    checkpoint_s: NotNegative = 30.0  # seconds between checkpoints; 0 writes one after every step


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """State of a run."""

    step: int
    steps: int
    loss: float  # mean since the last report
    figures: Mapping[str, float]  # of the last validation
    eta_s: float  # until the last step, at the pace of this slice


@dataclass(slots=True)
class _State:
    """All of a run but its tensors."""

    step: int = 0
    best: float = math.inf
    unused: int = 0  # in the sum of unused since the last validation
    history: list[dict[str, float]] = field(default_factory=list)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """A run at its end, or at the end of its slice."""

    finished: bool  # False where the time was up; call again to go on
    step: int  # steps done
    history: list[dict[str, float]]  # one row per validation: step, loss and its figures
    best: float  # lowest first figure so far


def train(
    module: torch.nn.Module,
    batches: Batches,
    loss: Unused,
    settings: Settings,
    checkpoint: Path,
    *,
    validate: Validate | None = None,
    deadline_s: float = math.inf,
    watch: Callable[[Progress], None] | None = None,
) -> Trained:
    """Train a module, or go on where its checkpoint stands.

    Parameters
    ----------
    module : torch.nn.Module
        On the device to train on; holds the kept weights once finished.
    loss : callable
        Of the module and a batch: a scalar.
    checkpoint : Path
        A safetensors file, read if it is there, written whole or not at all.
    validate : callable, optional
        Of the module: figures by name, the first of which decides what is best.
    deadline_s : float
        Reading of ``time.perf_counter`` at which to stop with a checkpoint.
    watch : callable, optional
        Told about once per second how the run stands.

    Raises
    ------
    NoSolutionError
        If the loss ceases to be a number.
    BadInputError
        If the checkpoint is damaged or of another recipe.
    """
    run = _Run(module, settings, checkpoint, validate)
    run.resume()
    costs = costs_of_plan()
    if costs is not None:
        return _planned(run, batches, loss, costs)
    pace = _Pace(run.state.step, settings.steps, watch)
    while run.state.step < settings.steps:
        step = run.state.step
        run.seed(settings.seed * _SPREAD + step)
        run.advance(batches(step), loss)
        last = run.state.step == settings.steps
        every = settings.validate_every
        if last or (every and run.state.step % every == 0):
            run.judge()
        now = perf_counter()
        if last or now >= deadline_s or now - run.saved_s >= settings.checkpoint_s:
            run.save()
            if now >= deadline_s and not last:
                return run.result(finished=False)
        pace.tell(run)
    run.take_kept()
    return run.result(finished=True)


def _planned(run: "_Run", batches: Batches, loss: Unused, costs: list[Cost]) -> Trained:
    """Take a step that warms up and one that is timed, in the place of all, and note the cost."""
    start_s = perf_counter()
    for step in range(2):
        start_s = perf_counter()
        run.seed(run.settings.seed * _SPREAD + step)
        run.advance(batches(step), loss)
        run.mean_loss()  # waits for the device
    cost = Cost(
        name=run.checkpoint.parent.name,
        parameters=sum(value.numel() for value in run.module.parameters()),
        steps=run.settings.steps,
        step_s=perf_counter() - start_s,
    )
    costs.append(cost)
    run.judge()
    run.save()
    run.take_kept()
    return run.result(finished=True)


class _Pace:
    """Tells about the run at most once per second, with the time that is left."""

    def __init__(self, first: int, steps: int, watch: Callable[[Progress], None] | None) -> None:
        self.first, self.steps, self.watch = first, steps, watch
        self.start_s = self.told_s = perf_counter()

    def tell(self, run: "_Run") -> None:
        now, step = perf_counter(), run.state.step
        if self.watch is None or (now - self.told_s < 1.0 and step < self.steps):
            return
        self.told_s = now
        eta_s = (now - self.start_s) / (step - self.first) * (self.steps - step)
        history = run.state.history
        figures = history[-1] if history else {}
        self.watch(
            Progress(
                step=step, steps=self.steps, loss=run.mean_loss(), figures=figures, eta_s=eta_s
            )
        )


class _Run:
    """A module, its optimiser and its state, which go to the checkpoint together."""

    def __init__(
        self,
        module: torch.nn.Module,
        settings: Settings,
        checkpoint: Path,
        validate: Validate | None,
    ) -> None:
        self.module, self.settings = module, settings
        self.checkpoint, self.validate = checkpoint, validate
        self.device = next(module.parameters()).device
        # AdamW: without decay it is Adam to the last bit
        self.optimizer = torch.optim.AdamW(
            module.parameters(),
            lr=settings.learning_rate,
            weight_decay=settings.weight_decay,
            fused=True,
        )
        self.kept: dict[str, torch.Tensor] = {}
        self.state = _State()
        self.loss_sum = torch.zeros((), dtype=torch.float64)  # on the device: reading it waits
        self.saved_s = perf_counter()

    def seed(self, number: int) -> None:
        """Set what dropout draws from; torch.manual_seed queues calls for GPUs that are absent."""
        torch.default_generator.manual_seed(number)
        if self.device.type == "cuda":
            torch.cuda.manual_seed(number)

    def advance(self, batch: Batch, loss: Unused) -> None:
        settings = self.settings
        for group in self.optimizer.param_groups:
            group["lr"] = _learning_rate(settings, self.state.step)
        self.module.train()
        self.optimizer.zero_grad(set_to_none=True)
        value = loss(self.module, batch)
        value.backward()
        if settings.clip_norm is not None:
            torch.nn.utils.clip_grad_norm_(self.module.parameters(), settings.clip_norm)
        self.optimizer.step()
        self.state.step += 1
        self.state.unused += 1
        self.loss_sum = self.loss_sum.to(value.device) + value.detach()

    def mean_loss(self) -> float:
        """Return the mean since the last validation, or up to it where that was just now."""
        if not self.state.unused:
            return self.state.history[-1]["loss"] if self.state.history else math.nan
        return float(self.loss_sum) / self.state.unused

    def judge(self) -> None:
        """Validate, note the figures, and keep the weights where they are the best so far."""
        mean = self.mean_loss()
        self.loss_sum, self.state.unused = torch.zeros_like(self.loss_sum), 0
        if not math.isfinite(mean):
            raise NoSolutionError(
                f"{self.checkpoint}: the loss is {mean} at step {self.state.step}; "
                "lower learning_rate, or set clip_norm"
            )
        self.module.eval()
        figures = {} if self.validate is None else self.validate(self.module)
        score = next(iter(figures.values()), mean)
        if self.settings.keep == "best" and score < self.state.best:
            self.kept = {k: v.detach().clone() for k, v in self.module.state_dict().items()}
        self.state.best = min(self.state.best, score)
        self.state.history.append({"step": self.state.step, "loss": mean, **figures})

    def take_kept(self) -> None:
        if self.kept:
            self.module.load_state_dict(self.kept)
        self.module.eval()

    def result(self, *, finished: bool) -> Trained:
        state = self.state
        return Trained(finished=finished, step=state.step, history=state.history, best=state.best)

    def save(self) -> None:
        state = self.state
        best = None if math.isinf(state.best) else state.best
        text = {
            "step": state.step,
            "best": best,
            "unused": state.unused,
            "history": state.history,
        }
        run = json.dumps({"settings": _settings_text(self.settings), "state": text})
        with atomic_file(self.checkpoint) as partial:
            # one key, for safetensors writes several in an order drawn anew
            save_file(self._tensors(), partial, metadata={"run": run})
        self.saved_s = perf_counter()

    def _tensors(self) -> dict[str, torch.Tensor]:
        moments: Mapping[int, Mapping[str, torch.Tensor]] = self.optimizer.state_dict()["state"]
        parts = {
            "weights": self.module.state_dict(),
            "kept": self.kept,
            "loss": {"sum": self.loss_sum},
            "moments": {f"{i}.{k}": v for i, inner in moments.items() for k, v in inner.items()},
        }
        return {
            f"{group}:{key}": value.detach().contiguous()
            for group, tensors in parts.items()
            for key, value in tensors.items()
        }

    def resume(self) -> None:
        """Take weights, moments and state from the checkpoint, if there is one."""
        if not self.checkpoint.exists():
            return
        run, parts = _read(self.checkpoint)
        if run.get("settings") != _settings_text(self.settings):
            raise BadInputError(
                f"{self.checkpoint}: is a checkpoint of other settings; name another folder, "
                "or delete it"
            )
        try:
            self.module.load_state_dict(parts["weights"])
        except RuntimeError as error:
            raise BadInputError(
                f"{self.checkpoint}: is a checkpoint of another network: {error}"
            ) from None
        own = self.optimizer.state_dict()
        moments: dict[int, dict[str, torch.Tensor]] = {}
        for key, value in parts["moments"].items():
            index, _, name = key.partition(".")
            moments.setdefault(int(index), {})[name] = value
        self.optimizer.load_state_dict({"state": moments, "param_groups": own["param_groups"]})
        self.kept = {key: value.to(self.device) for key, value in parts["kept"].items()}
        state = run["state"]
        state["best"] = math.inf if state["best"] is None else state["best"]
        self.state = _State(**state)
        self.loss_sum = parts["loss"]["sum"]


def _read(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, torch.Tensor]]]:
    names = ("weights", "kept", "moments", "loss")
    parts: dict[str, dict[str, torch.Tensor]] = {name: {} for name in names}
    try:
        with safe_open(path, framework="pt") as file:
            text = (file.metadata() or {}).get("run", "{}")
            run = msgspec.json.decode(text, type=dict[str, Any])
            for key in file.keys():  # noqa: SIM118  # not a mapping
                group, _, name = key.partition(":")
                parts[group][name] = file.get_tensor(key)
    except (SafetensorError, KeyError, msgspec.MsgspecError) as error:
        raise BadInputError(f"{path}: is no checkpoint of ours ({error}); delete it") from None
    return run, parts


def _settings_text(settings: Settings) -> str:
    """Return the settings that must not change between slices; the interval of checkpoints may."""
    return msgspec.json.encode(msgspec.structs.replace(settings, checkpoint_s=0.0)).decode()


def _learning_rate(settings: Settings, step: int) -> float:
    if settings.schedule == "constant":
        return settings.learning_rate
    return 0.5 * settings.learning_rate * (1.0 + math.cos(math.pi * step / settings.steps))

"""One experiment: a network, the data it learns from, and its figures beside those of baselines."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
import numpy as np
import torch
from safetensors.torch import load_file, save_file

from fgnav.checks import BadInputError, BoolArray, IntArray
from fgnav.io.atomic_write import atomic_file, made_folder, write_text
from fgnav.io.strict_toml import Positive, Table
from fgnav_models.training.ambiguity.baselines import Figures, figures
from fgnav_models.training.ambiguity.data import Parts, Rows, Samples, Shuffled
from fgnav_models.training.ambiguity.nets import (
    AmbiguityNet,
    Architecture,
    Task,
    cycles_of,
    loss_of,
    min_max,
    whitened,
)
from fgnav_models.training.order import Order
from fgnav_models.training.train import Batch, Settings
from fgnav_sim.ranges import Count

Targets: TypeAlias = Literal["benchmark", "each", "shared"]
_CHUNK = 4096  # rows answered at a time


class Experiment(Table, frozen=True):
    """A network and how it is trained."""

    task: Task = "classification"
    architecture: Architecture = Architecture()
    window: Count = 1  # samples that an answer sees
    # of the inputs: the paper's min-max, or ``whitened``
    scaling: Literal["min-max", "whitened"] = "min-max"
    # ``"benchmark"``: one double difference, ``repeats`` networks that differ by their first
    # weights; ``"each"``: one network per double difference; ``"shared"``: one backbone with a head
    # per double difference
    targets: Targets = "shared"
    # which difference that is; 0 is the first antenna's first pair
    benchmark: Annotated[int, msgspec.Meta(ge=0)] = 0
    repeats: Count = 1
    batch: Count = 1024
    passes: Positive = 10.0  # over the training rows
    learning_rate: Positive = 1e-3
    # the ``"best"`` weights by validation, or the ``"last"``
    keep: Literal["best", "last"] = "best"
    validations: Count = 10  # how often to validate on the way
    validation_rows: Annotated[int, msgspec.Meta(ge=1)] = 20_000
    seed: int = 1


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Result:
    """Result of an experiment."""

    columns: list[int]  # double difference of each target
    history: list[dict[str, float]]  # validation on the way
    # validation, test: ``Figures`` as lists, one entry per target; nothing where there were no
    # validation rows
    validation: dict[str, Any]
    test: dict[str, Any]
    rows: dict[str, int]  # of each part
    seconds: float  # of this slice's training


def columns_of(experiment: Experiment, differences: int) -> IntArray:
    """Return the double difference that each target of an experiment answers."""
    if experiment.targets == "benchmark":
        if experiment.benchmark >= differences:
            raise BadInputError(
                f"benchmark: must be a double difference, 0 to {differences - 1}, "
                f"got {experiment.benchmark}"
            )
        return np.full(experiment.repeats, experiment.benchmark)
    return np.arange(differences)


def network_of(
    experiment: Experiment, samples: Samples, parts: Parts, columns: IntArray
) -> AmbiguityNet:
    """Return the untrained network of an experiment, its inputs scaled by the training rows."""
    features = torch.from_numpy(samples.features[parts.train])
    offset, mix = (whitened if experiment.scaling == "whitened" else min_max)(features)
    return AmbiguityNet(
        experiment.architecture,
        task=experiment.task,
        window=experiment.window,
        offset=offset,
        mix=mix,
        targets=torch.from_numpy(columns),
        shared=experiment.targets == "shared",
        seed=experiment.seed,
    )


def run_experiment(
    name: str,
    experiment: Experiment,
    samples: Samples,
    parts: Parts,
    order: Order,
    *,
    columns: IntArray | None = None,
    keep_weights: bool = False,
) -> Result:
    """Train, judge on the test rows, and write ``NAME/result.json``.

    Parameters
    ----------
    name : str
        Folder under ``order.out``; what it holds already is taken, or gone on with.
    columns : ndarray of int, optional
        Double differences to answer; by default those of ``experiment.targets``.
    keep_weights : bool
        Leave ``weights.safetensors`` and the failures of the test, ``failures.safetensors``.

    Raises
    ------
    SliceOver
        If the time was up before the end.
    """
    folder = made_folder(order.out / name)
    done = folder / "result.json"
    if done.exists():
        return msgspec.json.decode(done.read_bytes(), type=Result)
    if columns is None:
        columns = columns_of(experiment, samples.cycles.shape[1])
    rows = Rows(samples, columns, experiment.window, order.device)
    net = network_of(experiment, samples, parts, columns).to(order.device)
    start_s = perf_counter()
    trained = order.train(
        name,
        net,
        Shuffled(rows, parts.train, experiment.batch, experiment.seed),
        lambda module, batch: _loss(experiment.task, module, batch),
        _settings(experiment, len(parts.train)),
        lambda module: _validation(experiment, module, rows, parts.validation),
    )
    seconds = perf_counter() - start_s
    answers = answers_of(net, rows, parts.test)
    if keep_weights:
        wrong = answers != samples.cycles[parts.test][:, columns]
        wrong &= samples.is_present[parts.test][:, columns]
        _save(folder / "weights.safetensors", net.state_dict())
        _save(folder / "failures.safetensors", {"failed": torch.from_numpy(wrong)})
    validation = {}
    if len(parts.validation):
        of_validation = answers_of(net, rows, parts.validation)
        validation = _judged(samples, parts.validation, columns, of_validation).to_dict()
    result = Result(
        columns=columns.tolist(),
        history=trained.history,
        validation=validation,
        test=_judged(samples, parts.test, columns, answers).to_dict(),
        rows={k: len(getattr(parts, k)) for k in ("train", "validation", "test")},
        seconds=seconds,
    )
    write_text(done, json.dumps(msgspec.to_builtins(result), indent=1) + "\n")
    (folder / "checkpoint.safetensors").unlink()
    return result


def _judged(samples: Samples, rows: IntArray, columns: IntArray, answers: IntArray) -> Figures:
    return figures(answers, samples.cycles[rows][:, columns], samples.is_present[rows][:, columns])


def read_failures(folder: Path) -> BoolArray:
    """Return the mask of failed test rows, (n, t), of an experiment that kept them."""
    failed: BoolArray = load_file(folder / "failures.safetensors")["failed"].numpy()
    return failed


def read_weights(net: AmbiguityNet, folder: Path) -> None:
    """Give a network the weights of an experiment that kept them."""
    net.load_state_dict(load_file(folder / "weights.safetensors"))
    net.eval()


def answers_of(net: AmbiguityNet, rows: Rows, of: IntArray) -> IntArray:
    """Return a network's integers, (n, t), of some rows."""
    net.eval()
    parts = [
        cycles_of(net.task, net(rows(some)[0])).cpu().numpy()
        for some in _chunks(rows.on_device(of))
    ]
    return np.concatenate(parts)


def _chunks(rows: torch.Tensor) -> Iterator[torch.Tensor]:
    with torch.no_grad():
        for start in range(0, len(rows), _CHUNK):
            yield rows[start : start + _CHUNK]


def _loss(task: Task, module: torch.nn.Module, batch: Batch) -> torch.Tensor:
    features, cycles, is_present = batch
    return loss_of(task, module(features), cycles, is_present)


def _settings(experiment: Experiment, rows: int) -> Settings:
    steps = max(1, ceil(experiment.passes * rows / experiment.batch))
    return Settings(
        steps=steps,
        learning_rate=experiment.learning_rate,
        seed=experiment.seed,
        keep=experiment.keep,
        validate_every=max(1, ceil(steps / experiment.validations)),
    )


def _validation(
    experiment: Experiment, module: torch.nn.Module, rows: Rows, of: IntArray
) -> Mapping[str, float]:
    """Return the loss that decides, and the share of wrong integers, over all targets."""
    if not len(of):
        return {}
    loss = wrong = total = 0.0
    some = of[:: ceil(len(of) / experiment.validation_rows)]
    for chunk in _chunks(rows.on_device(some)):
        features, cycles, is_present = rows(chunk)
        answer = module(features)
        loss += float(loss_of(experiment.task, answer, cycles, is_present)) * len(chunk)
        wrong += float(((cycles_of(experiment.task, answer) != cycles) & is_present).sum())
        total += float(is_present.sum())
    return {"validation_loss": loss / len(some), "wrong_percent": 100.0 * wrong / max(total, 1.0)}


def _save(path: Path, tensors: dict[str, torch.Tensor]) -> None:
    with atomic_file(path) as partial:
        save_file(
            {key: value.detach().cpu().contiguous() for key, value in tensors.items()}, partial
        )

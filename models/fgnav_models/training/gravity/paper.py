"""The paper's gravity networks: accelerations of 10,000 samples to gravity, by regression."""

from math import ceil
from typing import Literal

import msgspec
import numpy as np
import torch

from fgnav.io.atomic_write import made_folder, write_text
from fgnav.io.strict_toml import Positive, Table
from fgnav_models.training.ambiguity.experiment import SliceOver
from fgnav_models.training.ambiguity.nets import Architecture, Count
from fgnav_models.training.gravity.data import (
    BASELINES,
    Drawn,
    Rows,
    angles_deg,
    baseline,
    draw,
    rms,
    split,
)
from fgnav_models.training.gravity.nets import PaperGravity
from fgnav_models.training.order import Order
from fgnav_models.training.train import Batch, Settings, train
from fgnav_sim.data_sets.gravity import GravityEpochs
from fgnav_sim.data_sets.gravity_world import GravityWorld

By = Literal["samples", "flights"]
_DATA = 4  # stream of random numbers


class PaperStudy(Table, frozen=True):
    """The paper's data, split and networks."""

    samples: Count = 10_000
    shares: tuple[float, float, float] = (0.7, 0.15, 0.15)  # train, validate, test
    # ``"samples"`` as in the paper, where every flight is on all sides; ``"flights"``
    splits: tuple[By, ...] = ("samples", "flights")
    networks: dict[str, Architecture] = msgspec.field(default_factory=dict)
    # by the kind of architecture
    batches: dict[str, Count] = msgspec.field(default_factory=lambda: {"mlp": 200, "rnn": 16})
    passes: Positive = 200.0
    learning_rate: Positive = 1e-3

    def __post_init__(self) -> None:
        """Require a batch for each network."""
        for network in self.networks.values():
            if network.kind not in self.batches:
                raise ValueError(f"batches: must hold {network.kind}")


def run_paper(study: PaperStudy, world: GravityWorld, seed: int, order: Order) -> list[list[str]]:
    """Train each network on each split; return rows of the report, RMS errors in degrees.

    Raises
    ------
    SliceOver
        If the time was up before the end.
    """
    epochs = draw(world, study.samples, rng=np.random.default_rng([seed, _DATA]))
    found = []
    for by in study.splits:
        train_rows, validation_rows, test_rows = split(epochs.flight, study.shares, by, seed)
        apart = epochs[test_rows]
        where = f"unseen {by}"
        for name, architecture in study.networks.items():
            of = (epochs[train_rows], epochs[validation_rows])
            folder = f"{name} by {by}"
            error = _error_deg(architecture, study, of, apart, folder, seed, order)
            found.append([name, where, "RMS deg", f"{error:.4g}"])
        for name in BASELINES:
            error = rms(angles_deg(baseline(name, apart), apart.g_b))
            found.append([name, where, "RMS deg", f"{error:.4g}"])
    return found


def _error_deg(
    architecture: Architecture,
    study: PaperStudy,
    parts: tuple[GravityEpochs, GravityEpochs],
    apart: GravityEpochs,
    name: str,
    seed: int,
    order: Order,
) -> float:
    """Train one network and return its RMS error; what a folder holds already is taken."""
    folder = made_folder(order.out / name)
    done = folder / "rms_deg.txt"
    if done.exists():
        return float(done.read_text(encoding="utf-8"))
    seen, held = (_gravity(part) for part in parts)
    net = PaperGravity(architecture, *seen, seed).to(order.device)
    batch = study.batches[architecture.kind]
    steps = max(1, ceil(study.passes * len(parts[0]) / batch))
    trained = train(
        net,
        Drawn(tensors=tuple(t.to(order.device) for t in seen), batch=batch, seed=seed),
        _loss,
        Settings(
            steps=steps,
            learning_rate=study.learning_rate,
            schedule="constant",
            seed=seed,
            validate_every=max(1, ceil(steps / 20)),
        ),
        folder / "checkpoint.safetensors",
        validate=lambda module: _validation(module, tuple(t.to(order.device) for t in held)),
        deadline_s=order.deadline_s,
        watch=lambda progress: order.watch(name, progress),
    )
    if not trained.finished:
        raise SliceOver
    with torch.no_grad():
        estimated = net.cpu().gravity_b_mps2(Rows.of(apart).f_b_mps2).numpy().astype(float)
    error = rms(angles_deg(estimated, apart.g_b))
    write_text(done, f"{error!r}\n")
    return error


def _gravity(epochs: GravityEpochs) -> tuple[torch.Tensor, torch.Tensor]:
    rows = Rows.of(epochs)
    size = torch.from_numpy(epochs.gravity_mps2).float()
    return rows.f_b_mps2, rows.g_b * size[:, None]


def _loss(module: torch.nn.Module, batch: Batch) -> torch.Tensor:
    f_b_mps2, gravity_b_mps2 = batch
    return (module(f_b_mps2) - module.scaled(gravity_b_mps2)).square().mean()


def _validation(module: torch.nn.Module, held: tuple[torch.Tensor, ...]) -> dict[str, float]:
    with torch.no_grad():
        return {"mean_square": float(_loss(module, held))}

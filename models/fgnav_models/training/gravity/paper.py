"""The paper's gravity networks: accelerations of 10,000 samples to gravity, by regression."""

from dataclasses import dataclass
from math import ceil
from typing import Literal

import msgspec
import torch

from fgnav.io.atomic_write import made_folder, write_text
from fgnav.io.strict_toml import Table
from fgnav_models.training.ambiguity.experiment import Experiment
from fgnav_models.training.ambiguity.phases import Grid, three_phases
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
from fgnav_models.training.gravity.features import GRAVITY_MPS2
from fgnav_models.training.gravity.nets import PaperGravity
from fgnav_models.training.order import Order
from fgnav_models.training.train import Batch, Settings
from fgnav_sim.data_sets.gravity import GravityEpochs
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.ranges import Count

By = Literal["samples", "flights"]
_DATA = 4  # stream of random numbers


class PaperStudy(Table, frozen=True):
    """The paper's data, its split, and what its phases 1 to 3 try."""

    samples: Count = 10_000
    shares: tuple[float, float, float] = (0.7, 0.15, 0.15)  # train, validate, test
    # ``"samples"`` as in the paper, where every flight is on all sides; ``"flights"``
    splits: tuple[By, ...] = ("samples", "flights")
    start: Experiment = Experiment(task="regression", passes=200.0)
    grid: Grid = Grid(tasks=("regression",), types=("mlp", "rnn"))


def run_paper(study: PaperStudy, world: GravityWorld, seed: int, order: Order) -> list[list[str]]:
    """Run the phases on each split; return rows of the report, RMS errors in degrees.

    Raises
    ------
    SliceOver
        If the time was up before the end.
    """
    epochs = draw(world, study.samples, seed=[seed, _DATA])
    records = []
    for by in study.splits:
        rows = split(epochs.flight, study.shares, by, seed)
        bench = _Bench(parts=tuple(epochs[row] for row in rows), by=by, order=order, errors={})
        three_phases(study.grid, study.start, "regression", bench.score)
        where, unseen = f"unseen {by}", epochs[rows[2]]
        records += [
            [name, where, "RMS deg", f"{error:.4g}"] for name, error in bench.errors.items()
        ]
        for name in BASELINES:
            error = rms(angles_deg(baseline(name, unseen), unseen.g_b))
            records.append([name, where, "RMS deg", f"{error:.4g}"])
    return records


class _Outcome(msgspec.Struct, frozen=True):
    """Root mean square errors of an experiment, degrees."""

    validation_deg: float
    test_deg: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bench:
    """Trains networks on windows to train, to validate and to test."""

    parts: tuple[GravityEpochs, ...]
    by: By
    order: Order
    errors: dict[str, float]  # on the test windows, degrees, by the experiment's name

    def score(self, name: str, experiment: Experiment) -> float:
        """Return minus the error on the validation windows; what a folder holds is taken."""
        name_of_run = f"paper by {self.by}/{name}"
        done = made_folder(self.order.out / name_of_run) / "outcome.json"
        if done.exists():
            outcome = msgspec.json.decode(done.read_bytes(), type=_Outcome)
        else:
            net = self._trained(name_of_run, experiment)
            outcome = _Outcome(*(_error_deg(net, subset, experiment) for subset in self.parts[1:]))
            write_text(done, msgspec.json.encode(outcome).decode() + "\n")
        self.errors[name] = outcome.test_deg
        return -outcome.validation_deg

    def _trained(self, place: str, experiment: Experiment) -> PaperGravity:
        order = self.order
        training, held = (
            tuple(t.to(order.device) for t in _gravity(subset, experiment))
            for subset in self.parts[:2]
        )
        net = PaperGravity(experiment.architecture, training[0], training[1], experiment.seed)
        net.to(order.device)
        steps = max(1, ceil(experiment.passes * len(training[0]) / experiment.batch))
        order.train(
            place,
            net,
            Drawn(tensors=training, batch=experiment.batch, seed=experiment.seed),
            _loss,
            Settings(
                steps=steps,
                learning_rate=experiment.learning_rate,
                schedule="constant",
                seed=experiment.seed,
                validate_every=max(1, ceil(steps / experiment.validations)),
            ),
            lambda module: _validation(module, held),
        )
        net.cpu()
        return net


def _error_deg(net: PaperGravity, epochs: GravityEpochs, experiment: Experiment) -> float:
    with torch.no_grad():
        estimated = net.gravity_b_mps2(_gravity(epochs, experiment)[0]).numpy().astype(float)
    return rms(angles_deg(estimated, epochs.g_b))


def _gravity(epochs: GravityEpochs, experiment: Experiment) -> tuple[torch.Tensor, torch.Tensor]:
    rows = Rows.of(epochs)
    return rows.f_b_mps2[:, -experiment.window :], GRAVITY_MPS2 * rows.g_b


def _loss(module: torch.nn.Module, batch: Batch) -> torch.Tensor:
    f_b_mps2, gravity_b_mps2 = batch
    return (module(f_b_mps2) - module.scaled(gravity_b_mps2)).square().mean()


def _validation(module: torch.nn.Module, held: tuple[torch.Tensor, ...]) -> dict[str, float]:
    with torch.no_grad():
        return {"mean_square": float(_loss(module, held))}

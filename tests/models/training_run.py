"""A small training to be killed: ``python -m tests.models.training_run CHECKPOINT PAUSE_S``."""

import sys
from pathlib import Path
from time import sleep

import torch

from fgnav_models.training.train import Settings, Trained, train

SETTINGS = Settings(
    steps=60, learning_rate=0.02, validate_every=7, clip_norm=1.0, seed=4, checkpoint_s=0.0
)


def network():
    """Return a network with dropout, so that its steps need random numbers."""
    torch.manual_seed(11)
    return torch.nn.Sequential(
        torch.nn.Linear(3, 16), torch.nn.Tanh(), torch.nn.Dropout(0.2), torch.nn.Linear(16, 1)
    )


def batch(step):
    """Return points of a smooth function; the same step gives the same."""
    x = torch.rand((32, 3), generator=torch.Generator().manual_seed(1000 + step))
    return x, torch.sin(x.sum(dim=1, keepdim=True))


def squares(module, batch):
    """Return the mean squared error."""
    x, y = batch
    return (module(x) - y).square().mean()


def error(module):
    """Return the error on points apart."""
    with torch.no_grad():
        return {"error": float(squares(module, batch(-1)))}


def learn(module, checkpoint, settings=SETTINGS, **options) -> Trained:
    """Train, or go on."""
    return train(module, batch, squares, settings, checkpoint, validate=error, **options)


if __name__ == "__main__":
    torch.set_num_threads(1)

    def slow_batch(step):
        """Return the batch, slowly."""
        sleep(float(sys.argv[2]))
        return batch(step)

    train(network(), slow_batch, squares, SETTINGS, Path(sys.argv[1]), validate=error)

"""Learned factors from live torch modules: a module as a source of factors, and its export.

Trained through the smoother: a flight's posterior given a module, and proper scores of it.
"""

from fgnav_models.learn.flights import TrainingFlight, training_flight
from fgnav_models.learn.modules import export, factor, input_of
from fgnav_models.learn.pool import FlightPool
from fgnav_models.learn.posterior import Posterior, posterior
from fgnav_models.learn.scores import energy_score, nll

__all__ = [
    "FlightPool",
    "Posterior",
    "TrainingFlight",
    "energy_score",
    "export",
    "factor",
    "input_of",
    "nll",
    "posterior",
    "training_flight",
]

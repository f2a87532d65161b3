"""Judging networks: their answers against truth, and what they are worth in a method."""

from fgnav.evaluation.networks.calibration import Calibration, calibration
from fgnav.evaluation.networks.comparison import NetworksComparison, referee

__all__ = ["Calibration", "NetworksComparison", "calibration", "referee"]

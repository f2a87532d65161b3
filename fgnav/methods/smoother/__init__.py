"""Factor-graph smoothing: the only place with gtsam."""

from fgnav.methods.smoother.smoother import Batch, Forward, GtsamBatch, Smoother
from fgnav.methods.smoother.stream import Direction, Measured, Measurements, Stream, StreamSetUp

__all__ = [
    "Batch",
    "Direction",
    "Forward",
    "GtsamBatch",
    "Measured",
    "Measurements",
    "Smoother",
    "Stream",
    "StreamSetUp",
]

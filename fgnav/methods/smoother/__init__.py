"""Factor-graph smoothing: the only place with gtsam, and only for who asks for it."""

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

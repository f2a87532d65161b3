"""Factor-graph smoothing: the only place with gtsam."""

from fgnav.methods.smoother.smoother import Batch, Smoother

__all__ = ["Batch", "Smoother"]

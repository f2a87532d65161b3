"""Process of the body rate without a gyroscope: the Matern prior and its evidence."""

from fgnav.lazy import lazy

__getattr__ = lazy(__name__, {"hyperparameters": ("RatePrior",)})

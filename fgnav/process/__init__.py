"""How a body turns when nobody measures its rate: the Matern prior and its evidence."""

from fgnav.lazy import lazy

__getattr__ = lazy(__name__, {"hyperparameters": ("RatePrior",)})

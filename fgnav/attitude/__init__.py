"""From vectors and double differences to attitude, one epoch at a time."""

from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic

__all__ = ["AttitudeSolution", "RotationQuadratic", "maximum_likelihood"]

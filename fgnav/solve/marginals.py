"""Covariances of neighbouring keyframes, as every solver yields them."""

from typing import NamedTuple

from fgnav.checks import FloatArray


class Marginals(NamedTuple):
    """Covariances of m neighbouring keyframes, D dimensions each, and b constants."""

    covariance: FloatArray  # (m, D, D)
    cross: FloatArray  # (m, D, D), of each with the next; zero after the newest
    constant: FloatArray  # (b, b)
    constant_cross: FloatArray  # (m, D, b)

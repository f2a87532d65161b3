"""The compiled chain: a smoothing problem solved by block elimination, behind GTSAM's functions.

It owns the elimination; models of sensors and motion are read through ``linearise`` alone.
"""

from fgnav.solve.chain.batch import covariance_at, log_evidence, solve_batch
from fgnav.solve.chain.window import ChainWindow, solve_fixed_lag, solve_forward

__all__ = [
    "ChainWindow",
    "covariance_at",
    "log_evidence",
    "solve_batch",
    "solve_fixed_lag",
    "solve_forward",
]

"""A smoothing problem by compiled block elimination: evidence, covariances, where GTSAM begins.

It owns the elimination; models of sensors and motion are read through ``linearise`` alone.
"""

from fgnav.solve.chain.batch import covariance_at, log_evidence, solve_batch

__all__ = ["covariance_at", "log_evidence", "solve_batch"]

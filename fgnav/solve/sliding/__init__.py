"""GTSAM's incremental smoother as a sliding window."""

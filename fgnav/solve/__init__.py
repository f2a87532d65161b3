"""From a smoothing problem to its solution: GTSAM's window and batch."""

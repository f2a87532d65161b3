"""Data sets for training and Monte Carlo: epochs by the hundred thousand, no flights."""

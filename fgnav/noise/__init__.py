"""Noise of a flight's sensors by one marginal likelihood, with clock, latency and lever arm."""

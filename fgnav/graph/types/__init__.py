"""Parts of a smoothing problem, and its solution."""

"""Solvers, sources of factors and estimates that the three smoothers share."""

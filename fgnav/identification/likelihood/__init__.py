"""The marginal likelihood of noises on a thinned, linearised chain, and its greatest."""

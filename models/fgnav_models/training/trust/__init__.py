"""Training of the network that ranks integer candidates."""

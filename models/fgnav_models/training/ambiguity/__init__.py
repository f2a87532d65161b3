"""Training of the ambiguity networks, and the source paper's campaign."""

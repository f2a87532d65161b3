"""Integers along arcs: constant from one cycle slip to the next."""

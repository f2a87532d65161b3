"""Integers of a rigid array: the search that its known shape constrains."""

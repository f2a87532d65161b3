"""Rotations, splines and the Earth: mathematics that knows no sensor."""

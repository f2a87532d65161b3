"""Constellations and receivers: which signals are tracked, and what is measured of them."""

"""Attitudes at keyframes before any smoothing: of the array, of other vectors, by motion."""

"""Attitudes at keyframes before any smoothing: of the array or other vectors, and between them."""

"""Measurements of a stream, and their keyframes in the window."""

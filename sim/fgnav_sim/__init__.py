"""Simulator: flights whose truth is known."""

"""Innovations that single epochs do not show: redundancy of phases, position by code."""

"""Precise orbits and clocks in SP3 files: read and written."""

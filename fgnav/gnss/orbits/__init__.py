"""Positions and clocks of satellites, by broadcast messages or by precise tables."""

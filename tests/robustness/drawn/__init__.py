"""Flights and faults of theirs, drawn from seeds."""

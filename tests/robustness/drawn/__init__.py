"""Flights, faults of theirs and what they lack, drawn from seeds."""

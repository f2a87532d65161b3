"""Flights of vehicles of many kinds, whose way of moving is what a network may learn."""

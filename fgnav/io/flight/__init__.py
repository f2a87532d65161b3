"""Flights as folders: ``flight.toml`` and the tables it names."""

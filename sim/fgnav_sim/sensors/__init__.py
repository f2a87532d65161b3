"""Sensors beside GNSS: inertial, optical, barometer and magnetometer."""

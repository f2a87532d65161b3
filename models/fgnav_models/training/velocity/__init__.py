"""Velocity in body axes by an inertial unit alone, of vehicles of many kinds."""

"""Faults that last from one time to another: of the inertial unit, of an instrument."""

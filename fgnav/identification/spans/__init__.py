"""Faults that last from one time to another."""

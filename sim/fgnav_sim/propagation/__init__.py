"""Signals on their way: light time, delays, echoes, wind-up, errors of messages."""

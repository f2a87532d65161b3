"""Instruments beside the antennas, brought to the keyframes."""

"""Positions and velocities of an antenna at keyframes, by code, phase, Doppler or fixes."""

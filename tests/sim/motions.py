"""Motions that tests of the simulator fly."""

from fgnav_sim.motion import Arc, Motion, Sine, Straight

SWING = Motion(
    path=Arc(),
    roll=Sine(amplitude_deg=20.0),
    pitch=Sine(amplitude_deg=20.0),
    yaw=Sine(amplitude_deg=20.0),
)
STILL = Motion(path=Straight(speed_mps=0.0))

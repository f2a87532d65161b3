"""A flight as a factor graph: states, constants, measurements, motion, and their factors.

Owns the statement of every measurement: one file of ``factors`` holds one sensor's residual and
Jacobian, and GTSAM, the compiled chain, innovations and reports all read that one.
"""

from fgnav.graph.keys import Timeline, angular_motion, constant, imu_bias, pose, velocity

__all__ = ["Timeline", "angular_motion", "constant", "imu_bias", "pose", "velocity"]

"""A flight as a factor graph: states, constants, measurements, motion, and their factors.

Owns the statement of every measurement: one file of ``factors`` holds one sensor's residual and
Jacobian, and GTSAM, the batch, innovations and reports all read that one.
"""

from fgnav.graph.keys import Timeline, angular_motion, arcs, constant, imu_bias, pose, velocity
from fgnav.lazy import lazy

__all__ = ["Timeline", "angular_motion", "arcs", "constant", "imu_bias", "pose", "velocity"]

_HOMES = {  # loaded on first use: they bring GTSAM
    "custom": ("NamedFactor", "residual_factor"),
    "factors.antenna_phase": ("AntennaPhase", "ArcBlock", "PhaseRows"),
    "factors.array_phase": ("ArrayPhase",),
    "factors.barometer": ("BarometricHeight",),
    "factors.baseline": ("BaselineVector",),
    "factors.check": (
        *("FactorCheck", "check_factors", "check_sensor", "jacobian_misfit"),
        *("random_motion", "random_states", "values_of"),
    ),
    "factors.directions": ("Directions",),
    "factors.gravity": ("Gravity",),
    "factors.line_of_sight": ("LineOfSight",),
    "factors.magnetometer": ("MagneticField",),
    "factors.position": ("Position",),
    "factors.vehicle.aerodynamic_angles": ("AerodynamicAngles",),
    "factors.vehicle.wheels": ("RollingWheels",),
    "factors.velocity": ("Velocity",),
    "inertial.gyro_free": ("GyroFree",),
    "inertial.preintegrated": ("Inertial",),
    "sensor_rows": ("SensorRows", "Shapes", "sensor_factor"),
    "types.parameters": ("Parameter", "Parameters", "flight_constant"),
    "types.sensor": ("Linearised",),
    "types.states": ("POSITION", "RATE", "ROTATION", "VELOCITY", "States"),
}
__getattr__ = lazy(__name__, _HOMES)

"""From what keyframes measured to the graph's measurements, one for each sensor."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.array import float_arcs
from fgnav.frontend.array.multipath import symmetric_root
from fgnav.frontend.array.shape import BaselineForm, antenna_parts
from fgnav.frontend.position.series import VectorSeries
from fgnav.frontend.sensors.sensed import Sensed
from fgnav.graph.delayed import VELOCITY_DELAY, TimedMotion, on_clock
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.array_shape import ArrayShape
from fgnav.graph.factors.barometer import BarometricHeight
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.graph.factors.gravity import Gravity
from fgnav.graph.factors.line_of_sight import LineOfSight
from fgnav.graph.factors.magnetometer import MagneticField
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.vehicle.aerodynamic_angles import MEAN, WIND, AerodynamicAngles
from fgnav.graph.factors.vehicle.resting_rate import RestingRate
from fgnav.graph.factors.vehicle.standstill import Standstill
from fgnav.graph.factors.vehicle.wheels import AXES, AXLE, RollingWheels
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.sensor import Sensor


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Recorded:
    """What n keyframes measured."""

    array: RotationQuadratic | None  # of the array's phases
    array_valid: BoolArray  # (n,): keyframes whose phases take part
    float_stretch: IntArray  # (n,): stretch of epochs without integers that a keyframe is in, or -1
    shape: BaselineForm | None  # where antennas are estimated: stands in for ``array`` where it is
    antennas: tuple[str, ...]  # the reference first
    positions: tuple[VectorSeries, ...]  # fixes of antennas
    velocities: tuple[VectorSeries, ...]  # of antennas
    sensed: Sensed
    gravity_n_mps2: FloatArray  # (n, 3)
    measured_b_radps: FloatArray | None  # (n, 3): by a gyroscope
    earth_rate_n_radps: FloatArray  # (3,)
    # By which measurements of other clocks are carried to keyframes.
    timed: TimedMotion | None = None
    multipath: Multipath | None = None  # what of their errors stays


def sensors_of(recorded: Recorded, constants: Constants) -> tuple[Sensor, ...]:
    """Return the graph's measurements of all sensors that have any."""
    gnss = (*_array(recorded, constants), *_antenna(recorded, constants))
    gnss = (*gnss, *_baselines(recorded, constants))
    others = (
        *_directions(recorded, constants),
        *_surroundings(recorded, constants),
        *_vehicle(recorded, constants),
        *_standstill(recorded, constants),
    )
    timed = recorded.timed
    if timed is not None:
        late = {"velocity": VELOCITY_DELAY}
        gnss = tuple(on_clock(m, timed, constants, delay=late.get(m.name, "")) for m in gnss)
    return tuple(part for part in (*gnss, *others) if len(part.row))


def _array(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    form, shape, valid = recorded.array, recorded.shape, recorded.array_valid
    if form is None:
        return
    if shape is not None:
        row = np.flatnonzero(shape.valid)
        parts = antenna_parts(constants.parts, recorded.antennas)
        yield ArrayShape(
            row=row,
            root=shape.root[row],
            minimum_n_m=shape.minimum[row],
            baselines_b_m=shape.baselines_b_m,
            column=np.array([constants.first[k] if k >= 0 else -1 for k in parts]),
            constants=constants,
        )
        valid = valid & ~shape.valid
    row = np.flatnonzero(valid & (form.count > 0))
    form, lasting = form[row], recorded.multipath
    if lasting is not None and recorded.measured_b_radps is not None:
        form, lasting = form.with_variance_factor(lasting.inflation()[row]), None
    root, minimum = form.square_root()
    if lasting is not None:
        root = symmetric_root(form.information)[0]
    yield ArrayPhase(
        row=row,
        root=root,
        minimum=minimum,
        element_column=_columns(
            constants, float_arcs.NAME, recorded.float_stretch[row], float_arcs.ELEMENTS
        ),
        constants=constants,
        **({} if lasting is None else {"share": lasting.share[row], "basis": lasting.basis}),
    )


def _antenna(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    lever = constants.column("lever-arm")
    timed = recorded.timed
    is_late = timed is not None and constants.column(VELOCITY_DELAY) >= 0
    for position in recorded.positions:
        row = np.flatnonzero(position.valid)
        yield Position(
            row=row,
            value_n_m=position.value[row],
            white=position.white(row),
            arm_b_m=position.arm_b_m,
            lever_column=lever,
            constants=constants,
        )
    for velocity in recorded.velocities:
        measured = recorded.measured_b_radps
        valid = velocity.valid & timed.led if timed is not None and is_late else velocity.valid
        moving = np.flatnonzero(valid)
        yield Velocity(
            row=moving,
            value_n_mps=velocity.value[moving],
            white=velocity.white(moving),
            arm_b_m=velocity.arm_b_m,
            measured_b_radps=None if measured is None else measured[moving],
            earth_rate_n_radps=recorded.earth_rate_n_radps,
            lever_column=lever,
            constants=constants,
        )


def _baselines(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    for one in recorded.sensed.baselines:
        yield BaselineVector(**one._asdict(), constants=constants)


def _columns(constants: Constants, name: str, number: IntArray, size: int) -> IntArray:
    """Return the first column of each one's part of a constant, (k,); -1 of those without."""
    first = constants.column(name)
    if first < 0:
        return np.full(len(number), -1, dtype=np.int64)
    return np.where(number >= 0, first + size * number, -1).astype(np.int64)


def _directions(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    gravity, sight = recorded.sensed.gravity, recorded.sensed.sight
    if gravity is not None:
        row = gravity.row
        down_n = recorded.gravity_n_mps2[row]
        yield Gravity(
            row=row,
            known_n=down_n / np.linalg.norm(down_n, axis=1, keepdims=True),
            across_b=gravity.across_b[row],
            tilt_column=constants.column("gravity"),
            constants=constants,
        )
    if sight is not None and constants.column("landmark") >= 0:
        yield LineOfSight(
            row=sight.row,
            across_b=sight.across_b[sight.row],
            landmark_column=constants.column("landmark"),
            boresight_column=constants.column("boresight"),
            constants=constants,
        )


def _surroundings(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    heights, field = recorded.sensed.heights, recorded.sensed.field
    if heights is not None:
        row = np.flatnonzero(np.isfinite(heights.down_n_m))
        node = np.floor(heights.place[row]).astype(np.int64)
        yield BarometricHeight(
            row=row,
            down_n_m=heights.down_n_m[row],
            sigma_m=heights.sigma_m,
            arm_b_m=heights.arm_b_m,
            column=constants.column("barometer"),
            node=node,
            share=heights.place[row] - node,
            constants=constants,
        )
    if field is not None:
        seen = field.directions
        yield MagneticField(
            row=seen.row,
            across_b=seen.across_b[seen.row],
            field_n_ut=field.field_n_ut,
            iron_column=constants.column("hard iron"),
            constants=constants,
        )


def _vehicle(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    wheels, measured = recorded.sensed.wheels, recorded.measured_b_radps
    airflow = recorded.sensed.airflow
    if airflow is not None:
        yield AerodynamicAngles(
            row=airflow.row,
            sigma_rad=airflow.sigma_rad,
            wind_column=constants.column(WIND),
            mean_column=constants.column(MEAN),
            constants=constants,
        )
    if wheels is not None:
        yield RollingWheels(
            row=wheels.row,
            slip_mps=wheels.slip_mps,
            arm_b_m=wheels.arm_b_m,
            measured_b_radps=None if measured is None else measured[wheels.row],
            earth_rate_n_radps=recorded.earth_rate_n_radps,
            axes_column=constants.column(AXES),
            axle_column=constants.column(AXLE),
            constants=constants,
        )


def _standstill(recorded: Recorded, constants: Constants) -> Iterator[Sensor]:
    if recorded.sensed.standing is not None:
        yield Standstill(**recorded.sensed.standing._asdict())
    if recorded.sensed.resting is not None:
        yield RestingRate(
            **recorded.sensed.resting._asdict(),
            earth_rate_n_radps=recorded.earth_rate_n_radps,
            constants=constants,
        )

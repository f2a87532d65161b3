"""What sensors and set-ups get wrong: one list, for tests and for the yardstick.

A fault changes a right flight into one whose values are well-formed, and wrong.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.geometry.earth import C_MPS
from fgnav.types.flight import Flight
from tests.robustness import shapes
from tests.robustness.shapes import Draw

DEGREE, G, KNOT, FOOT = 180.0 / np.pi, 9.80665, 3600.0 / 1852.0, 1 / 0.3048
L1_HZ = 1_575.42e6


@dataclass(frozen=True)
class Fault:
    """A fault, by the sensor a flight must have."""

    sensor: str
    name: str
    change: Callable[[Flight, Draw], Flight]

    def __call__(self, flight: Flight, rng: np.random.Generator) -> tuple[Flight, str]:
        """Return the flight with the fault, and the fault in words."""
        draw = Draw(rng)
        changed = self.change(flight, draw)
        return changed, f"{self.name}: {', '.join(draw.words)}"

    def concerns(self, flight: Flight) -> bool:
        """Return whether a flight has what goes wrong."""
        if self.sensor == "gyroscope":
            return flight.imu is not None and flight.imu.w_b_radps is not None
        if self.sensor == "array":
            return len(flight.antennas) > 1
        return getattr(flight, self.sensor) not in (None, ())


def faulty(flight: Flight, seed: int) -> tuple[Flight, str]:
    """Return a flight with a fault of a sensor it has, drawn from a seed, and its words."""
    rng = np.random.default_rng([91, seed])
    possible = [fault for fault in FAULTS if fault.concerns(flight)]
    return possible[int(rng.integers(len(possible)))](flight, rng)


def _record(flight: Flight, sensor: str) -> Any:
    return flight.fixes[0] if sensor == "fixes" else getattr(flight, sensor)


def _with(flight: Flight, sensor: str, **changes: Any) -> Flight:
    record = replace(_record(flight, sensor), **changes)
    return replace(flight, **{sensor: (record,) if sensor == "fixes" else record})


def of_field(
    sensor: str, field: str, shape: Callable[..., Any], *sizes: Any, relative: bool = False
) -> Fault:
    """Return a fault of a field; ``relative`` sizes are shares of its largest magnitude."""

    def change(flight: Flight, draw: Draw) -> Flight:
        record = _record(flight, sensor)
        values = getattr(record, field)
        scale = np.nanmax(np.abs(values)) if relative else 1.0
        wrong = scale * shape(values / scale, record.t_s, draw, *sizes)
        return _with(flight, sensor, **{field: wrong})

    of = "gyroscope" if field == "w_b_radps" else sensor
    return Fault(of, f"{sensor} {field} {shape.__name__.replace('_', ' ')}", change)


def of_times(sensor: str, shape: Callable[..., Any]) -> Fault:
    """Return a fault of timestamps."""

    def change(flight: Flight, draw: Draw) -> Flight:
        return _with(flight, sensor, t_s=shape(_record(flight, sensor).t_s, draw))

    return Fault(sensor, f"{sensor} timestamps {shape.__name__}", change)


def _samples_lost(flight, draw):
    """Lose samples whose timestamps are counted on."""
    imu = flight.imu
    kept = imu[draw.rng.random(len(imu.t_s)) > draw.size(0.001, 0.1)]
    return replace(flight, imu=replace(kept, t_s=imu.t_s[: len(kept.t_s)]))


def _without_gravity(flight, _draw):
    """Give accelerations without gravity, as telephones do."""
    truth, imu = flight.truth, flight.imu
    k = np.searchsorted(truth.t_s, imu.t_s).clip(0, len(truth.t_s) - 1)
    gravity = np.einsum("kji,j->ki", truth.R_nb[k], [0.0, 0.0, G])
    return _with(flight, "imu", f_b_mps2=imu.f_b_mps2 + gravity)


def _frozen(flight, draw):
    fixes = flight.fixes[0]
    inside = draw.span(fixes.t_s)
    p_n_m, v_n_mps = fixes.p_n_m.copy(), fixes.v_n_mps.copy()
    for values in (p_n_m, v_n_mps):
        values[inside] = values[np.argmax(inside)]
    return _with(flight, "fixes", p_n_m=p_n_m, v_n_mps=v_n_mps)


def _sigmas_small(flight, draw):
    fixes, by = flight.fixes[0], draw.size(3.0, 30.0)
    return _with(
        flight,
        "fixes",
        position_sigma_m=fixes.position_sigma_m / by,
        velocity_sigma_mps=fixes.velocity_sigma_mps / by,
    )


def _east_for_north(flight, _draw):
    return _with(flight, "fixes", v_n_mps=flight.fixes[0].v_n_mps[:, [1, 0, 2]] * [1, 1, -1])


def _arm_wrong(flight, draw):
    by = draw.size(0.1, 5.0) * draw.direction()
    moved = (replace(one, position_b_m=one.position_b_m + by) for one in flight.antennas)
    return replace(flight, antennas=tuple(moved))


def _antenna_moved(flight, draw):
    k, moved = draw.channel(len(flight.antennas)), list(flight.antennas)
    by = draw.size(0.01, 2.0) * draw.direction()
    moved[k] = replace(moved[k], position_b_m=moved[k].position_b_m + by)
    return replace(flight, antennas=tuple(moved))


def _antennas_misaligned(flight, draw):
    """Give the antennas in axes of another convention, or turned by some degrees."""
    turns = {
        "up and left": np.diag([1.0, -1.0, -1.0]),
        "mirrored": np.diag([1.0, -1.0, 1.0]),
        "x right, y forward": np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]),
        "5 degrees": draw.rotation(np.radians(5.0)),
        "20 degrees": draw.rotation(np.radians(20.0)),
        "10 % longer": 1.1 * np.eye(3),
    }
    turn = turns[draw.choice(*turns)]
    moved = (replace(one, position_b_m=turn @ one.position_b_m) for one in flight.antennas)
    return replace(flight, antennas=tuple(moved))


def _clock_jumps(flight, draw):
    """Jump phases and code, or phases alone, by a millisecond or less."""
    seen, jump_s = flight.observations, draw.choice(1e-3, 1e-6, 1e-7)
    inside = draw.span(seen.t_s)[:, None, None]
    phase = seen.phase_cycles + inside * L1_HZ * jump_s
    code_m = seen.code_m + inside * C_MPS * jump_s * draw.choice(0, 1)
    return _with(flight, "observations", code_m=code_m, phase_cycles=phase)


def _satellite_drifts(flight, draw):
    seen, j = flight.observations, draw.channel(len(flight.observations.satellites))
    drift_m = draw.size(0.5, 10.0) * seen.t_s[:, None]
    code_m, phase = seen.code_m.copy(), seen.phase_cycles.copy()
    code_m[..., j] += drift_m
    phase[..., j] += drift_m * L1_HZ / C_MPS
    return _with(flight, "observations", code_m=code_m, phase_cycles=phase)


def _links_exchanged(axis, fields):
    """Return a change that exchanges two antennas (axis 1) or two satellites (axis 2)."""

    def change(flight, draw):
        seen = flight.observations
        order = np.arange(seen.code_m.shape[axis])
        i, j = draw.told(draw.rng.permutation(len(order))[:2].tolist())
        order[[i, j]] = j, i
        inside = draw.span(seen.t_s)[:, None, None]
        values = {name: getattr(seen, name) for name in fields}
        wrong = {name: np.where(inside, x.take(order, axis), x) for name, x in values.items()}
        return _with(flight, "observations", **wrong)

    return change


def _declination_wrong(flight, draw):
    """State the field of another declination, as of a chart read the wrong way."""
    off_rad = np.radians(draw.choice(2.0, -5.0, 15.0, -60.0, 180.0))
    c, s = np.cos(off_rad), np.sin(off_rad)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return _with(flight, "magnetometer", field_n_ut=turn @ flight.magnetometer.field_n_ut)


def _landmark_moved(flight, draw):
    place = flight.photodetector.landmark_n_m + draw.size(5.0, 300.0) * draw.direction()
    return _with(flight, "photodetector", landmark_n_m=place)


def _detector_other(flight, draw):
    detector = flight.photodetector
    focal_length_m = detector.focal_length_m * (1 + draw.signed(0.05, 0.5))
    place = detector.position_b_m + draw.size(0.1, 10.0) * np.array([1.0, 0.0, 0.0])
    return _with(flight, "photodetector", focal_length_m=focal_length_m, position_b_m=place)


RAW = ("code_m", "phase_cycles", "doppler_hz", "lock_flags")
TRIADS = (("imu", "f_b_mps2"), ("imu", "w_b_radps"), ("magnetometer", "field_b_ut"))
UNITS = (DEGREE, 1 / DEGREE, G, 1 / G, 1e3, 1e-3)
TRIAD: tuple[tuple[Any, ...], ...] = (
    (shapes.scaled, 0.5, 0.8, 0.9, 1.1, 1.25, 2.0, *UNITS),
    (shapes.channel_scaled, -1.0, 0.0, 0.5, 0.8, 1.25, 2.0),
    (shapes.channel_stuck,),
    (shapes.stuck,),
    (shapes.exchanged,),
    (shapes.misaligned, 3.0, 10.0, 30.0, 90.0),
    (shapes.stepped, 0.03, 2.0),
    (shapes.drifting, 0.003, 0.2),
    (shapes.clipped,),
    (shapes.coarse,),
    (shapes.noisy, 0.01, 1.0),
    (shapes.outlying, 1.0, 100.0),
    (shapes.held,),
    (shapes.lagging,),
)
FIELDS: tuple[tuple[Any, ...], ...] = (  # sensor, field, shape and its sizes in the field's unit
    ("fixes", "p_n_m", shapes.stepped, 3.0, 100.0),
    ("fixes", "p_n_m", shapes.drifting, 0.3, 10.0),
    ("fixes", "p_n_m", shapes.noisy, 1.0, 50.0),
    ("fixes", "p_n_m", shapes.outlying, 10.0, 1000.0),
    ("fixes", "v_n_mps", shapes.scaled, KNOT, 1 / KNOT, 3.6, FOOT, 0.9, 1.1, -1.0, 0.0),
    ("fixes", "v_n_mps", shapes.channel_scaled, -1.0),
    ("fixes", "v_n_mps", shapes.noisy, 0.1, 10.0),
    ("fixes", "v_n_mps", shapes.old),
    ("barometer", "height_m", shapes.scaled, FOOT, 1 / FOOT, -1.0, 100.0, 0.9),
    ("barometer", "height_m", shapes.stepped, 3.0, 100.0),
    ("barometer", "height_m", shapes.drifting, 0.3, 10.0),
    ("barometer", "height_m", shapes.stuck),
    ("barometer", "height_m", shapes.outlying, 5.0, 1000.0),
    ("photodetector", "currents", shapes.exchanged),
    ("photodetector", "currents", shapes.channel_scaled, 0.0, 0.5, 0.8, 1.25, 2.0),
    ("photodetector", "currents", shapes.stuck),
    ("observations", "code_m", shapes.channel_stepped, 10.0, 1000.0),
    ("observations", "phase_cycles", shapes.slipping),
    ("observations", "phase_cycles", shapes.noisy, 0.03, 0.5),
    ("observations", "phase_cycles", shapes.channel_stuck),
    ("observations", "doppler_hz", shapes.scaled, -1.0, 0.0, 0.9, 2.0),
    ("observations", "doppler_hz", shapes.channel_stepped, 1.0, 50.0),
)
FAULTS: tuple[Fault, ...] = (
    *(of_field(*of, *shape, relative=True) for of in TRIADS for shape in TRIAD),
    *(of_field(*row) for row in FIELDS),
    of_field("photodetector", "currents", shapes.lit, 0.03, 10.0, relative=True),
    *(
        of_times(sensor, shape)
        for sensor in ("imu", "barometer", "magnetometer", "photodetector")
        for shape in (shapes.late, shapes.stretched, shapes.jumping, shapes.jittering)
    ),
    of_times("fixes", shapes.jittering),  # estimates are in their time, which no other knows
    Fault("imu", "imu samples lost", _samples_lost),
    Fault("imu", "imu without gravity", _without_gravity),
    Fault("fixes", "fixes frozen", _frozen),
    Fault("fixes", "fixes sigmas too small", _sigmas_small),
    Fault("fixes", "fixes velocities east, north, up", _east_for_north),
    Fault("fixes", "fixes lever arm", _arm_wrong),
    Fault("observations", "observations lever arm", _arm_wrong),
    Fault("observations", "observations clock jumps", _clock_jumps),
    Fault("observations", "observations of a satellite drift", _satellite_drifts),
    Fault("observations", "satellites exchanged", _links_exchanged(2, (*RAW, "cn0_dbhz"))),
    Fault("array", "antennas exchanged", _links_exchanged(1, RAW)),
    Fault("array", "antenna moved", _antenna_moved),
    Fault("array", "antennas misaligned", _antennas_misaligned),
    Fault("magnetometer", "declination wrong", _declination_wrong),
    Fault("photodetector", "landmark moved", _landmark_moved),
    Fault("photodetector", "detector of another focal length", _detector_other),
)
BY_NAME = {fault.name: fault for fault in FAULTS}

"""What identification tells a user, in sentences."""

from collections.abc import Mapping

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.sensors.rest import AT_REST
from fgnav.graph.types.motion import INERTIAL_NOISES
from fgnav.identification.lasting import arm
from fgnav.identification.lasting.clock import clock_sentence
from fgnav.identification.likelihood.thinned import FIELDS
from fgnav.identification.noise.identified import Identified
from fgnav.types.estimate import Rejected
from fgnav.types.flight import Imu
from fgnav.types.instruments import GnssNoise

_WHAT = {
    "accelerometer": "Accelerometer noise in motion",
    "gyroscope": "Gyroscope noise in motion",
    "accelerometer bias": "Random walk of the accelerometer's bias",
    "gyroscope bias": "Random walk of the gyroscope's bias",
    "position": "Noise of fix positions",
    "velocity": "Noise of velocities",
    "barometric height": "Noise of barometric heights",
    "line of sight": "Noise of the seeker's lines of sight",
    "magnetic field": "Noise of the magnetometer",
    "satellite error": "Size of satellites' errors",
    "satellite error walk": "Random walk of satellites' errors",
    "satellite error rate": "Rate of satellites' errors",
    "code": "Noise of codes",
}
_UNIT = {
    "accelerometer": "m/s2/sqrt(Hz)",
    "gyroscope": "rad/s/sqrt(Hz)",
    "accelerometer bias": "m/s2/sqrt(s)",
    "gyroscope bias": "rad/s/sqrt(s)",
}
_OF_SATELLITES = {
    "satellite error walk": "satellite_error_walk_m_per_sqrt_s",
    "satellite error rate": "satellite_error_rate_mps",
}
_USUAL = "the usual figure"
_SHOWN = 3  # spans of a sentence


def noise_notes(imu: Imu | None, identified: Identified) -> tuple[str, ...]:
    """Return a sentence for each noise that replaces what the flight has."""
    notes = []
    for i in np.flatnonzero(identified.used).tolist():
        name, factor = identified.names[i], float(identified.factor[i])
        moving = identified.factors.get(name.removesuffix(AT_REST), 1.0)
        if name.endswith(AT_REST) and factor == moving:
            continue
        value = _value(imu, name, factor)
        if identified.stated[i]:
            stated = _USUAL if name == "line of sight" else "what flight.toml states"
            times = f"{factor:.2g} x {stated}"
            cause = _cause(identified) if identified.exceeds_noise[i] else ""
            notes.append(f"{_what(name)} is {times}{value and f', {value}'}: used instead{cause}.")
        else:
            usual = value or f"{factor:.2g} x {_USUAL}"
            notes.append(f"{_what(name)}, not stated, is identified as {usual}.")
    return tuple(notes)


def doubt_notes(doubted: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence on noises by which a unit counts that the record leaves open."""
    listed = [
        f"{_what(name)} as {factor:.2g} x what flight.toml states"
        for name, factor in doubted.items()
        if not name.endswith(AT_REST)
    ]
    if not listed:
        return ()
    return (
        "The inertial unit is not as its data sheet has it, and the record so far leaves open how "
        f"loud the rest of it is: {', '.join(listed)} until it tells.",
    )


def _cause(identified: Identified) -> str:
    """Return what may be wrong where the unit's noise is none."""
    others = dict.fromkeys(name for name in identified.names if name not in INERTIAL_NOISES)
    against = f", or of {', '.join(others)}" if others else ""
    return (
        "; so much is no noise: an axis, a sign, a scale, a unit or a time of the inertial unit"
        f"{against} is not as stated"
    )


def _value(imu: Imu | None, name: str, factor: float) -> str:
    name = name.removesuffix(AT_REST)
    if imu is None or name not in FIELDS:
        return ""
    return f"{factor * getattr(imu, FIELDS[name]):.2g} {_UNIT[name]}"


def _what(name: str) -> str:
    moving = _WHAT[name.removesuffix(AT_REST)]
    return moving if not name.endswith(AT_REST) else moving.removesuffix(" in motion") + AT_REST


def satellite_error_notes(noise: GnssNoise, factors: Mapping[str, float]) -> tuple[str, ...]:
    """Return a sentence for each size of satellites' errors that the flight contradicts."""
    return tuple(
        f"{_WHAT[name]} is {factor:.2g} x what flight.toml states: used instead."
        if _is_stated(noise, name)
        else f"{_WHAT[name]}, not stated, is identified as {factor:.2g} x {_USUAL}."
        for name, factor in factors.items()
    )


def _is_stated(noise: GnssNoise, name: str) -> bool:
    if name == "code":
        return "code_m" not in noise.unstated
    field = _OF_SATELLITES.get(name)
    return field is not None and getattr(noise, field) != getattr(GnssNoise(), field)


def constant_notes(
    identified: Identified, moved: FloatArray, requests: tuple[CalibrationRequest, ...]
) -> tuple[str, ...]:
    """Return sentences on the clock, late velocities and the lever arm, where they matter."""
    notes, kinds = [], [one.kind for one in requests]
    value, sigma = identified.times.value.copy(), identified.times.sigma
    clock = [one for one in requests if one.kind == "clock"]
    value[:2] += clock[0].moved if clock else moved
    is_off = any(any(one.moved) for one in clock)
    is_off |= bool(clock) and bool(identified.times.significant[:2].any())
    if identified.times.are_one_or_the_other:
        notes.append(
            "The inertial unit's clock or the velocities of fixes are late, the flight does not "
            f"tell which: clock {value[0]:+.3f} s, velocities {value[2]:.3f} s (± {sigma[0]:.3f} s "
            "each, one against the other); both are estimated with the flight."
        )
        kinds = [one for one in kinds if one not in ("clock", "velocity-delay")]
    elif moved.any() or is_off:
        then = "corrected, and estimated with the flight" if "clock" in kinds else "corrected"
        notes.append(clock_sentence(value[:2], sigma[:2], then))
    if "velocity-delay" in kinds:
        notes.append(
            f"Velocities of fixes are {value[2]:.3f} ± {sigma[2]:.3f} s old: estimated with the "
            "flight."
        )
    if identified.arm is not None and identified.arm.significant:
        notes.append(arm.sentence(identified.arm.off, identified.arm.covariance))
    return tuple(notes)


def exclusion_notes(out: tuple[Rejected, ...]) -> tuple[str, ...]:
    """Return a sentence for each kind of measurement that is left out."""
    by: dict[str, list[Rejected]] = {}
    for one in out:
        by.setdefault(one.what, []).append(one)
    notes = []
    for what, rejected in by.items():
        shown = [(f"{one.from_s:.1f} to {one.until_s:.1f} s", one.reason) for one in rejected]
        more = f" and {len(shown) - _SHOWN} more spans" if len(shown) > _SHOWN else ""
        name = what[:1].upper() + what[1:]
        if len({reason for _, reason in shown}) == 1:
            spans = ", ".join(span for span, _ in shown[:_SHOWN])
            notes.append(f"{name} from {spans}{more}: {rejected[0].reason}.")
        else:
            spans = "; ".join(f"{span}: {reason}" for span, reason in shown[:_SHOWN])
            notes.append(f"{name} from {spans}{more and ';' + more}.")
    return tuple(notes)

"""What samples of barometer, detector and magnetometer give away: one that is stuck, or a unit."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.frontend.faulty_samples import stuck_run
from fgnav.set_up.findings import Finding
from fgnav.types.flight import Flight
from fgnav.types.surroundings import Magnetometer

_FEWEST = 20  # samples
_TWICE = 2.0  # the Earth's field; scale factors of sensors are a tenth off, units a factor of ten
_IRON_SIGMAS = 3.0  # of the vehicle's own field, along each axis at once


def instrument_findings(flight: Flight) -> list[Finding]:
    """Return instruments that repeat a sample, and fields of a size that the Earth's has not."""
    findings = []
    if flight.barometer is not None:
        t_s, height_m = flight.barometer.t_s, flight.barometer.height_m[:, None]
        findings += _stuck("barometer", t_s, height_m, np.ones(len(t_s), dtype=np.bool_))
    if flight.seeker is not None:
        t_s, currents = flight.seeker.t_s, flight.seeker.currents
        findings += _stuck("seeker", t_s, currents, currents.min(axis=1) > 0)
    if flight.magnetometer is not None:
        t_s, field_b_ut = flight.magnetometer.t_s, flight.magnetometer.field_b_ut
        findings += _stuck("magnetometer", t_s, field_b_ut, np.ones(len(t_s), dtype=np.bool_))
        findings += _field_size(flight.magnetometer)
    return findings


def _stuck(name: str, t_s: FloatArray, x: FloatArray, is_valid: BoolArray) -> list[Finding]:
    """Return a run of equal samples, of those that say anything, that chance does not explain."""
    t_s, x = t_s[is_valid], x[is_valid]
    run = stuck_run(x) if len(t_s) >= _FEWEST else None
    if run is None:
        return []
    first, length = run
    text = (
        f"one sample is repeated {length + 1} times from {t_s[first]:.3f} to "
        f"{t_s[first + length]:.3f} s"
    )
    mend = "cut these samples out"
    return [Finding(name=f"{name} stuck", text=text, where=f"[{name}] samples", mend=mend)]


def _field_size(sensor: Magnetometer) -> list[Finding]:
    """Return a field that is far larger or smaller than the Earth's and the vehicle's can be."""
    size_ut = np.linalg.norm(sensor.field_b_ut, axis=1)
    earth_ut = float(np.linalg.norm(sensor.field_n_ut))
    own_ut = _IRON_SIGMAS * np.sqrt(3.0) * sensor.hard_iron_ut
    off = (size_ut > _TWICE * earth_ut + own_ut) | (size_ut < earth_ut / _TWICE - own_ut)
    if len(off) < _FEWEST or off.mean() < 1 / _FEWEST:
        return []
    begin_s, end_s = sensor.t_s[off][[0, -1]]
    text = (
        f"the field is {np.median(size_ut[off]):.3g} uT in {int(off.sum())} of {len(off)} samples, "
        f"{begin_s:.3f} to {end_s:.3f} s, the Earth's is {earth_ut:.3g} uT"
    )
    mend = "give both in microtesla; of the field only the direction is used"
    where = "[magnetometer] samples, field_n_ut"
    return [Finding(name="magnetometer unit", text=text, where=where, mend=mend)]

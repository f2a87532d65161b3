"""Faults that samples alone show: axes that are constant, samples that are repeated."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.diagnostics.contents import Finding
from fgnav.frontend.faulty_samples import stuck_axis, stuck_run, stuck_unit
from fgnav.types.flight import Flight, Imu

_MIN_SAMPLES, _MIN_OF_INSTRUMENT = 100, 20


def sample_findings(imu: Imu) -> list[Finding]:
    """Return axes that are constant, all or one repeating a sample longer than chance explains."""
    t_s, findings = imu.t_s, []
    if len(t_s) < _MIN_SAMPLES:
        return []
    run = stuck_unit(imu)
    if run is not None:
        return [_stuck("imu stuck", "all axes repeat one sample", t_s, run, "[imu] samples")]
    for sensor, letters, x in (
        ("accelerometer axis", "f{}_mps2", imu.f_b_mps2),
        ("gyroscope axis", "w{}_radps", imu.w_b_radps),
    ):
        if x is None or (x == x[0]).all():  # simulated without noise, at rest
            continue
        for axis, letter in enumerate("xyz"):
            where = f"[imu] samples, {letters.format(letter)}"
            run = stuck_axis(x, axis, np.zeros(len(x), dtype=np.bool_))
            if (x[:, axis] == x[0, axis]).all():
                text = f"axis {letter} is {x[0, axis]:g} in all {len(x)} samples"
                mend = "not connected, or a filler: the flight cannot be used"
                findings.append(Finding(sensor, text, mend, where, certain=True))
            elif run is not None:
                text = f"axis {letter} repeats {x[run[0], axis]:.6g}"
                findings.append(_stuck(sensor, text, t_s, run, where))
    return findings


def instrument_findings(flight: Flight) -> list[Finding]:
    """Return instruments that repeat a sample longer than chance explains."""
    findings, series = [], {}
    if flight.barometer is not None:
        series["barometer"] = (flight.barometer.t_s, flight.barometer.height_m[:, None])
    if flight.seeker is not None:
        seen = flight.seeker.currents.min(axis=1) > 0
        series["seeker"] = (flight.seeker.t_s[seen], flight.seeker.currents[seen])
    if flight.magnetometer is not None:
        series["magnetometer"] = (flight.magnetometer.t_s, flight.magnetometer.field_b_ut)
    for name, (t_s, x) in series.items():
        run = stuck_run(x) if len(t_s) >= _MIN_OF_INSTRUMENT else None
        if run is not None:
            text, where = "one sample is repeated", f"[{name}] samples"
            findings.append(_stuck(f"{name} stuck", text, t_s, run, where))
    return findings


def _stuck(name: str, text: str, t_s: FloatArray, run: tuple[int, int], where: str) -> Finding:
    first_s, last_s = t_s[run[0]], t_s[run[0] + run[1]]
    text += f" {run[1] + 1} times from {first_s:.3f} to {last_s:.3f} s"
    return Finding(name, text, "left out of estimates, or cut these samples out", where)

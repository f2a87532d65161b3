"""Faults that samples alone show: axes that are constant, samples that are repeated."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.diagnostics.contents import Finding
from fgnav.frontend.faulty_samples import stuck_axis, stuck_run, stuck_unit
from fgnav.types.flight import Flight, Imu

_MIN_SAMPLES, _MIN_OF_INSTRUMENT = 100, 20
_AXES = "xyz"


def sample_findings(imu: Imu) -> list[Finding]:
    """Return axes that are constant, all or one repeating a sample longer than chance explains."""
    if len(imu.t_s) < _MIN_SAMPLES:
        return []
    run = stuck_unit(imu)
    if run is not None:
        return [_stuck("imu stuck", "all axes repeat one sample", imu.t_s, run)]
    findings = []
    for sensor, letters, x in (
        ("accelerometer", "f{}_mps2", imu.f_b_mps2),
        ("gyroscope", "w{}_radps", imu.w_b_radps),
    ):
        if x is None or (x == x[0]).all():  # simulated without noise, at rest
            continue
        for axis, letter in enumerate(_AXES):
            where = f"[imu] samples, {letters.format(letter)}"
            if (x[:, axis] == x[0, axis]).all():
                text = f"axis {letter} is {x[0, axis]:g} in all {len(x)} samples"
                mend = "not connected, or a filler: the flight cannot be used"
                name = f"{sensor} axis"
                findings.append(Finding(name=name, text=text, where=where, mend=mend, certain=True))
                continue
            run = stuck_axis(x, axis, np.zeros(len(x), dtype=np.bool_))
            if run is not None:
                text = f"axis {letter} repeats {x[run[0], axis]:.6g} while the others move"
                findings.append(_stuck(f"{sensor} axis", text, imu.t_s, run, where))
    return findings


def instrument_findings(flight: Flight) -> list[Finding]:
    """Return instruments that repeat a sample longer than chance explains."""
    series: list[tuple[str, FloatArray, FloatArray, BoolArray | None]] = []
    if flight.barometer is not None:
        series.append(("barometer", flight.barometer.t_s, flight.barometer.height_m[:, None], None))
    if flight.seeker is not None:
        currents = flight.seeker.currents
        series.append(("seeker", flight.seeker.t_s, currents, currents.min(axis=1) > 0))
    if flight.magnetometer is not None:
        series.append(
            ("magnetometer", flight.magnetometer.t_s, flight.magnetometer.field_b_ut, None)
        )
    findings = []
    for name, t_s, x, is_valid in series:
        kept = slice(None) if is_valid is None else is_valid
        times_s, values = t_s[kept], x[kept]
        run = stuck_run(values) if len(times_s) >= _MIN_OF_INSTRUMENT else None
        if run is not None:
            text = "one sample is repeated"
            findings.append(_stuck(f"{name} stuck", text, times_s, run, f"[{name}] samples"))
    return findings


def _stuck(
    name: str, text: str, t_s: FloatArray, run: tuple[int, int], where: str = "[imu] samples"
) -> Finding:
    first, length = run
    return Finding(
        name=name,
        text=f"{text}: {length + 1} times from {t_s[first]:.3f} to {t_s[first + length]:.3f} s",
        where=where,
        mend="left out of estimates, or cut these samples out",
    )

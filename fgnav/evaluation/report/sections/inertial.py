"""The inertial unit's noise by averaging time, as recorded and as stated."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.blocks import Blocks, grid, paragraph
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, decades, log10
from fgnav.evaluation.report.drawing.shapes import Drawing
from fgnav.process.allan import (
    allan_deviation,
    longest_run,
    stated_deviation,
)
from fgnav.types.flight import Flight

_LEAST = 100  # samples: of fewer, a tenth is not a decade of averaging times


def allan_parts(flight: Flight) -> Blocks:
    """Return the Allan deviations of accelerometer and gyroscope; empty without a unit."""
    imu = flight.imu
    if imu is None:
        return []
    run = longest_run(imu.t_s)
    t_s = imu.t_s[run]
    if len(t_s) < _LEAST:
        return []
    charts = _charts(
        "accelerometer",
        "m/s²",
        t_s,
        imu.f_b_mps2[run],
        (imu.accelerometer_noise_mps2_per_sqrt_hz, imu.accelerometer_bias_walk_mps2_per_sqrt_s),
    )
    density, walk = (
        imu.gyroscope_noise_radps_per_sqrt_hz,
        imu.gyroscope_bias_walk_radps_per_sqrt_s,
    )
    if imu.w_b_radps is not None and density is not None and walk is not None:
        stated = (float(np.degrees(density)), float(np.degrees(walk)))
        charts += _charts("gyroscope", "deg/s", t_s, np.degrees(imu.w_b_radps[run]), stated)
    return paragraph(
        f"Allan deviation of {len(t_s)} samples from {t_s[0]:.1f} to {t_s[-1]:.1f} s, the longest "
        "run without a gap, up to a tenth of it. The body's motion is in it: where a line falls "
        "along the dashed one, or the body stands still, it is the unit's noise. Dashed: white "
        "noise and random walk of the bias as the set-up states them."
    ) + grid(charts)


def _charts(
    name: str, unit: str, t_s: FloatArray, values: FloatArray, stated: tuple[float, float]
) -> list[Drawing]:
    """Return a diagram for each axis, all on one scale."""
    tau_s, deviation = allan_deviation(values, float(np.median(np.diff(t_s))))
    x, expected = np.log10(tau_s), log10(stated_deviation(tau_s, *stated))
    y = decades(f"Allan deviation, {unit}", [log10(deviation).ravel(), expected])
    return [
        Chart(
            title=f"{name} {axis}: Allan deviation",
            x=Axis(name="averaging time, s", low=float(x[0]), high=float(x[-1]), log=True),
            y=y,
            lines=[
                Line(mark="own", name="as recorded", x=x, y=log10(own), as_is=True, width=1.6),
                Line(mark="truth", name="as stated", x=x, y=expected, as_is=True),
            ],
        ).drawing()
        for axis, own in zip("xyz", deviation.T, strict=True)
    ]

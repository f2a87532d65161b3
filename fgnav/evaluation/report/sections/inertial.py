"""The inertial unit's noise by averaging time, as recorded and as stated."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.charts import RECORDED, TRUTH, Chart, Line
from fgnav.evaluation.report.parts import Blocks, grid, paragraph
from fgnav.process.allan import allan_deviation, longest_run, stated_deviation
from fgnav.types.flight import Flight

_LEAST = 100  # samples: of fewer, a tenth is not a decade of averaging times


def allan_blocks(flight: Flight) -> Blocks:
    """Return the Allan deviations of accelerometer and gyroscope; empty without a unit."""
    imu = flight.imu
    run = None if imu is None else longest_run(imu.t_s)
    if imu is None or run is None or len(imu.t_s[run]) < _LEAST:
        return []
    t_s = imu.t_s[run]
    noise = (imu.accelerometer_noise_mps2_per_sqrt_hz, imu.accelerometer_bias_walk_mps2_per_sqrt_s)
    charts = _charts("accelerometer", "m/s²", t_s, imu.f_b_mps2[run], noise)
    density, walk = imu.gyroscope_noise_radps_per_sqrt_hz, imu.gyroscope_bias_walk_radps_per_sqrt_s
    if imu.w_b_radps is not None and density is not None and walk is not None:
        noise = (float(np.degrees(density)), float(np.degrees(walk)))
        charts += _charts("gyroscope", "deg/s", t_s, np.degrees(imu.w_b_radps[run]), noise)
    return paragraph(
        f"Allan deviation of {len(t_s)} samples from {t_s[0]:.1f} to {t_s[-1]:.1f} s, the longest "
        "run without a gap, up to a tenth of it. The body's motion is in it: where a line falls "
        "along the dashed one, or the body stands still, it is the unit's noise. Dashed: white "
        "noise and random walk of the bias as the set-up states them."
    ) + grid(charts)


def _charts(
    name: str, unit: str, t_s: FloatArray, values: FloatArray, noise: tuple[float, float]
) -> list[Chart]:
    """Return a figure for each axis, all on one scale."""
    tau_s, deviation = allan_deviation(values, float(np.median(np.diff(t_s))))
    expected = stated_deviation(tau_s, *noise)
    every = np.concatenate([deviation.ravel(), expected])
    limits = float(every[every > 0].min()), float(every.max())
    return [
        Chart(
            f"{name} {axis}: Allan deviation",
            f"Allan deviation, {unit}",
            [Line(RECORDED, tau_s, y), Line(TRUTH, tau_s, expected, "as stated")],
            "averaging time, s",
            log="xy",
            y_limits=limits,
        )
        for axis, y in zip("xyz", deviation.T, strict=True)
    ]

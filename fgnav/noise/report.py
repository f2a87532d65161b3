"""Messages on the estimated noise and time parameters of a flight."""

from collections.abc import Mapping

import numpy as np

from fgnav.graph.factors.position import LEVER_ARM
from fgnav.messages import Note, note
from fgnav.noise.calibration import LATENCY, calibration_notes
from fgnav.noise.components import AT_REST, WHITE
from fgnav.noise.identify import Hyperparameters
from fgnav.noise.nominal import FIELDS, unstated
from fgnav.noise.posterior import STATED
from fgnav.process.allan import FEWEST, allan_deviation, longest_run
from fgnav.types.flight import Flight, Imu
from fgnav.types.instruments import GnssNoise

_NAMES = {
    "accelerometer": "Accelerometer noise",
    "gyroscope": "Gyroscope noise",
    "accelerometer bias": "Accelerometer bias random walk",
    "gyroscope bias": "Gyroscope bias random walk",
    "position": "Noise of fixed positions",
    "velocity": "Noise of velocities",
    "baseline": "Noise of baselines",
    "barometric height": "Barometer noise",
    "line of sight": "Line-of-sight noise",
    "magnetic field": "Magnetometer noise",
    "satellite error": "Satellite range error",
    "satellite error walk": "Satellite range error random walk",
    "satellite error rate": "Satellite range error rate",
    "code": "Code noise",
    "phase": "Phase noise of the reference antenna",
}
_UNITS = {
    "accelerometer": "m/s²/√Hz",
    "gyroscope": "rad/s/√Hz",
    "accelerometer bias": "m/s²/√s",
    "gyroscope bias": "rad/s/√s",
}
_WORTH_SAYING = np.log(1.5)
_BIASES = {"accelerometer": "accelerometer_bias_mps2", "gyroscope": "gyroscope_bias_radps"}
_MEASURED_M = 0.05  # 1-sigma of an antenna's place as a tape measures it
_CERTAIN = 4.0  # sigmas of a logarithm: 3e-5
_NEAR_S = 1 / 3  # below, a cubic rotation between epochs errs by less than noise
_SIGMAS = 3.0  # of what is known before the flight


def noise_notes(flight: Flight, result: Hyperparameters) -> tuple[str, ...]:
    """Return a message for each noise that differs by half from the nominal, and for set-up.

    Parameters
    ----------
    flight : Flight
        With its nominal noise.
    result : Hyperparameters
    """
    usual = (*unstated(flight), *_usual_of_gnss(flight.gnss_noise))
    factors = {**result.factors, **result.satellites}
    notes = [
        _noise_note(flight.imu, name, factor, is_usual=name.removesuffix(AT_REST) in usual)
        for name, factor in factors.items()
        if abs(np.log(factor)) > _WORTH_SAYING
    ]
    return (*notes, *calibration_notes(result.calibrated))


def implausible(flight: Flight, result: Hyperparameters) -> dict[str, float]:
    """Return ratios of noise to its largest plausible value, where above 1.

    Three sigmas are the largest: over the record a bias walks by no more of what is stated of it, a
    lever arm is measured to a tape's sigma, and a latency is within what is known before the flight
    and not negative. Stated noise of other sensors holds to four sigmas of its prior. Without a
    gyroscope, noise also stands for what the path of the rotation between distant epochs of the
    array leaves of the force: then it is not tested.

    Parameters
    ----------
    flight : Flight
        With its nominal noise.
    result : Hyperparameters
    """
    imu, given = flight.imu, unstated(flight)
    ratios = {
        name: factor / np.exp(_CERTAIN * STATED)
        for name, factor in result.factors.items()
        if not name.startswith(WHITE) and name.removesuffix(AT_REST) not in given
    }
    for one in result.significant:
        if one.kind == LEVER_ARM:
            ratios["lever arm"] = float(np.linalg.norm(one.value)) / (_SIGMAS * _MEASURED_M)
        if one.kind == LATENCY:
            sigma_s = one.prior_sigma if one.value[0] > 0.0 else float(one.sigma[0])
            ratios["velocity latency"] = abs(float(one.value[0])) / (_SIGMAS * sigma_s)
    if imu is not None:
        epochs = flight.observations if imu.w_b_radps is None else None
        if epochs is None or np.median(np.diff(epochs.t_s)) < _NEAR_S:
            ratios |= _noise_ratios(imu, result.factors, result.sigmas)
        root_s = np.sqrt(imu.t_s[-1] - imu.t_s[0])
        for sensor, field in _BIASES.items():
            walk, bias = getattr(imu, FIELDS[f"{sensor} bias"].name), getattr(imu, field)
            if walk and bias:
                factor = result.factors.get(f"{sensor} bias", 1.0)
                ratios[f"{sensor} bias"] = float(factor * walk * root_s / (_SIGMAS * bias))
                if factor <= 1.0:  # as stated
                    del ratios[f"{sensor} bias"]
    return {name: ratio for name, ratio in ratios.items() if ratio > 1.0}


def _noise_ratios(
    imu: Imu, factors: Mapping[str, float], sigmas: Mapping[str, float]
) -> dict[str, float]:
    """Return white noise of a unit over the largest that its samples can hold.

    White noise of density N has the Allan deviation ``N / sqrt(tau)`` from one sample to the next,
    and whatever else there is, such as motion, only adds to it. What is estimated above that is no
    noise, if its logarithm is above by four sigmas. The noisiest axis counts.
    """
    run = longest_run(imu.t_s)
    if run.stop - run.start < FEWEST:
        return {}
    step_s = float(np.median(np.diff(imu.t_s[run])))
    ratios: dict[str, float] = {}
    for name, values in zip(WHITE, (imu.f_b_mps2, imu.w_b_radps), strict=True):
        density = getattr(imu, FIELDS[name].name)
        if values is not None and factors.get(name, 1.0) > 1.0:
            tau_s, deviation = allan_deviation(values[run], step_s)
            largest = float(deviation[0].max() * np.sqrt(tau_s[0]))
            ratio = factors[name] * density / max(largest, np.finfo(float).tiny)
            if np.log(ratio) > _CERTAIN * sigmas.get(name, 0.0):
                ratios[name] = ratio
    return ratios


def _noise_note(imu: Imu | None, name: str, factor: float, *, is_usual: bool) -> Note:
    component = name.removesuffix(AT_REST)
    where = " at standstill" if name.endswith(AT_REST) else ""
    unit = _UNITS.get(component)
    density = None if imu is None or unit is None else getattr(imu, FIELDS[component].name)
    value = "" if density is None else f"{factor * density:.2g} {unit}, "
    of = "usual figure" if is_usual else "nominal"
    return note("I301", noise=f"{_NAMES[component]}{where}", value=value, factor=factor, of=of)


def _usual_of_gnss(noise: GnssNoise) -> tuple[str, ...]:
    default = GnssNoise()
    names = ["satellite error"]
    if noise.satellite_error_walk_m_per_sqrt_s == default.satellite_error_walk_m_per_sqrt_s:
        names.append("satellite error walk")
    if noise.satellite_error_rate_mps == default.satellite_error_rate_mps:
        names.append("satellite error rate")
    names += [name for name in ("code", "phase") if f"{name}_m" in noise.unstated]
    return tuple(names)

"""A filter before its heading is known: level alone, and a specific force that points anywhere.

Until the heading is observable, each horizontal acceleration, of unknown direction in body axes,
is noise of the accelerometer: its power spectral density is that of a process of this size
held for half an alignment's window. Else a window at rest takes the accelerometer's noise for
motion, and so finds a spurious heading. A filter runs about an arbitrary heading meanwhile; once
it is known it begins again at the first keyframe, linearised where the gyroscope carries that
heading back to: nothing that was marginalised is wrong by a turn.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from fgnav.alignment.in_motion.windows import WINDOW_S
from fgnav.alignment.initial import attitude_prior
from fgnav.assembly.position.phases import antenna_phase
from fgnav.assembly.position.series import VectorSeries
from fgnav.assembly.stages import Aligned, Tracked, approximate_motion
from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.factors.antenna_phase import AntennaPhase
from fgnav.graph.factors.vehicle.wheels import NAME as WHEELS
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.problem import ROTATION_PRIOR_RAD, Opening, Problem
from fgnav.types.estimate import open_angle_variance_rad2
from fgnav.types.flight import InitialAttitude

_SPANS_S = (1.0, 2.0, 4.0)  # over which accelerations are differences of fixes
FIXED_RAD = 0.01  # of a heading held fixed: linear systems stay well posed
_SURE_MPS2 = 0.3  # of their noise: a third of what cars, boats and walkers accelerate by


def until_motion(
    problem: Problem, stage: Aligned, track: Tracked, initial: InitialAttitude | None
) -> Problem:
    """Return a problem without information about heading by specific force before motion.

    Its first heading is known as well as the gyroscope carries it back from there.
    """
    start, imu = stage.start, stage.record.imu
    if not stage.gyroscope or start.heading_from_s <= problem.t_s[0]:
        return problem
    sigma_rad = float(stage.carried_sigma_rad[0])
    if start.form is not None:
        sigma_rad = (imu.gyroscope_bias_radps or 0.0) * (start.heading_from_s - start.t_s[0])
    sigma_rad = min(sigma_rad + FIXED_RAD, ROTATION_PRIOR_RAD)
    noisy = _with_force_noise(problem, track, problem.t_s[1:] <= start.heading_from_s)
    return replace(noisy, attitude_prior=attitude_prior(initial, start.R_nb[0], sigma_rad))


def open_heading(
    problem: Problem, stage: Aligned, track: Tracked, initial: InitialAttitude | None
) -> Opening | None:
    """Return a problem as windows have it before the heading is known; None if it always is.

    About one heading, held fixed: nothing depends on which, but all turns with it.
    """
    t_s, start, until_s = problem.t_s, problem.start, stage.heading_known_s
    if not stage.gyroscope or until_s <= t_s[0]:
        return None
    R_nb = start.R_nb if stage.R_open is None else stage.R_open
    position = track.antenna.position
    if position is None:
        return None
    p_n_m, v_n_mps = approximate_motion(stage, track, R_nb)
    # They speak of the heading, which here is arbitrary.
    parts = tuple(sensor for sensor in problem.sensors if sensor.name != WHEELS)
    phase = _phase_before_heading(problem, stage, track)
    without_wheels = replace(problem, sensors=parts, phase=phase)
    opening = replace(
        _with_force_noise(without_wheels, track, np.ones(len(t_s) - 1, dtype=np.bool_)),
        start=start._replace(R_nb=R_nb, p_n_m=p_n_m, v_n_mps=v_n_mps),
        attitude_prior=attitude_prior(initial, R_nb[0], FIXED_RAD),
    )
    stated = None if initial is None else initial.heading_sigma_rad
    variance_rad2 = open_angle_variance_rad2()
    return Opening(
        problem=opening,
        until_s=until_s,
        heading_variance_rad2=variance_rad2 if stated is None else min(variance_rad2, stated**2),
        arm_b_m=position.arm_b_m,
        aligned=problem,
    )


def _phase_before_heading(problem: Problem, stage: Aligned, track: Tracked) -> AntennaPhase | None:
    """Return phases before the heading is known: turns wind them up about an open one, too."""
    phases, t_s = track.antenna.phases, track.t_s
    if stage.R_open is None or all(phase.of.pole_n is None for phase in phases):
        return problem.phase
    before = [t_s[phase.row] < stage.heading_known_s for phase in phases]
    observed = tuple(
        phase._replace(row=phase.row[rows], epoch=phase.epoch[rows])
        for phase, rows in zip(phases, before, strict=True)
    )
    return antenna_phase(observed, t_s, stage.R_open, problem.constants, causal=True).phase


def _with_force_noise(problem: Problem, track: Tracked, intervals: BoolArray) -> Problem:
    """Return a problem whose accelerometer is taken for noise along the horizontal acceleration."""
    motion = problem.motion
    if not isinstance(motion, Inertial) or not intervals.any():
        return problem
    velocity = next(iter(track.antenna.velocities), None)
    size_mps2 = horizontal_mps2(problem.t_s, velocity, track.antenna.position)
    more = np.where(intervals, WINDOW_S * size_mps2[1:] ** 2, 0.0)
    return replace(problem, motion=motion.with_added_noise(more, np.zeros_like(more)))


def horizontal_mps2(
    t_s: FloatArray, velocity: VectorSeries | None, position: VectorSeries | None
) -> FloatArray:
    """Return the size of the horizontal acceleration at keyframes, (n,), by fixes up to each.

    By differences of velocities, or second ones of positions, over the shortest span at which
    their noise is below a third of a metre per second squared.
    """
    series = [(velocity, 1, np.sqrt(2)), (position, 2, np.sqrt(6))]
    options = [
        (one, order, span_s, factor * _sigma(one) / span_s**order)
        for one, order, factor in series
        if one is not None and one.valid.any()
        for span_s in _SPANS_S
    ]
    if not options:
        return np.zeros(len(t_s))
    sure = [option for option in options if option[3] <= _SURE_MPS2]
    one, order, span_s, _ = sure[0] if sure else min(options, key=lambda option: option[3])
    rows = np.flatnonzero(one.valid)
    at_s, values = t_s[rows], one.value[rows, :2]
    back = [np.searchsorted(at_s, at_s - k * span_s - 1e-6).clip(0) for k in range(order + 1)]
    slopes = [
        (values[a] - values[b]) / (at_s[a] - at_s[b]).clip(span_s / 2)[:, None]
        for a, b in pairwise(back)
    ]
    change = slopes[0] if order == 1 else (slopes[0] - slopes[1]) / span_s
    size = np.linalg.norm(change, axis=1)
    last = (np.searchsorted(rows, np.arange(len(t_s)), side="right") - 1).clip(0)
    return np.asarray(size[last])


def _sigma(series: VectorSeries) -> float:
    """Return the horizontal 1-sigma of a series' first value: those to come are not known yet."""
    first = int(series.valid.argmax())
    return float(np.sqrt(np.trace(series.covariance[first, :2, :2]) / 2))

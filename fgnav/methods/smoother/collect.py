"""From a flight to keyframes: what each GNSS epoch measured, and where to start."""

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from fgnav.attitude.own_rotation import spun
from fgnav.checks import BoolArray, FloatArray, Loss, NoSolutionError
from fgnav.estimate import Rejected
from fgnav.flight import Flight, Imu
from fgnav.gravity import GravityEstimator
from fgnav.integers.resolver import Integers, Resolver
from fgnav.methods.smoother import instruments, surroundings
from fgnav.methods.smoother.antenna_motion import antenna_motion
from fgnav.methods.smoother.array_shape import shape_at, shaped
from fgnav.methods.smoother.bursts import Intensity, intensity
from fgnav.methods.smoother.constants import (
    ANTENNAS,
    Asked,
    FlightConstant,
    constants_of,
    with_evidence,
)
from fgnav.methods.smoother.density import density_of_rough_attitudes
from fgnav.methods.smoother.few import with_few
from fgnav.methods.smoother.filling import filled, held_on
from fgnav.methods.smoother.float_arcs import Floating, with_float_arcs
from fgnav.methods.smoother.gaps import (
    LONGEST_GAP_S,
    LOST_S,
    Bridged,
    BridgingPreintegrator,
    bridged,
    density_in_gaps,
    hardly_known,
    keyframe_times,
    spans,
    told,
    without_attitude,
)
from fgnav.methods.smoother.gate import gated
from fgnav.methods.smoother.keyframes import ArrayForm, Keyframes, Timed
from fgnav.methods.smoother.pieces import in_pieces
from fgnav.methods.smoother.preintegration import increments
from fgnav.methods.smoother.rates import Rates
from fgnav.methods.smoother.starts import Start, at_keyframes, start_of
from fgnav.methods.smoother.surroundings import with_offsets

_FEWEST = 5  # attitudes that tell how briskly a body turns


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the user may choose; see ``Smoother``."""

    resolver: Resolver
    gravity: GravityEstimator | None
    angular_acceleration_density: float | None
    sub_steps: int
    false_alarm: float
    constants: tuple[Asked, ...] = ()
    own_factors: bool = True  # float arcs, offsets of positions: GTSAM has none for them
    causal: bool = False  # each keyframe by what came before it alone: no bridge knows its end


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Collected:
    """Keyframes of a flight, and what is to be said of them.

    Attributes
    ----------
    keyframes : Keyframes
    epochs : int
        GNSS epochs of the flight, and times between them that are far apart.
    common_position_m2 : ndarray, shape (n, 3, 3)
        Variance of positions at keyframes that no smoothing reduces.
    common_velocity_m2ps2 : ndarray, shape (n, 3, 3)
        Of the velocity at which such errors move.
    integers : Integers or None
    losses : tuple of Loss
    rejections : tuple of Rejected
    notes : tuple of str
    rough : bool
        Whether how well attitudes are known that the search starts from is a guess.
    """

    keyframes: Keyframes
    epochs: int
    common_position_m2: FloatArray
    common_velocity_m2ps2: FloatArray
    integers: Integers | None
    losses: tuple[Loss, ...]
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]
    rough: bool = False


_LATEST: WeakKeyDictionary[Flight, tuple[Settings, Collected]] = WeakKeyDictionary()


def collect(flight: Flight, settings: Settings) -> Collected:
    """Return the keyframes of a flight: its GNSS epochs within the accelerometer's record.

    What was collected last is kept as long as the flight lives, so that methods of one comparison
    share it; if the settings hash, as frozen dataclasses do.

    Raises
    ------
    NoSolutionError
        Naming the part of the flight that is missing.
    """
    try:
        hash(settings)
    except TypeError:
        return _collected(flight, settings)
    known = _LATEST.get(flight)
    if known is None or known[0] != settings:
        known = _LATEST[flight] = settings, _collected(flight, settings)
    return known[1]


def _collected(flight: Flight, settings: Settings) -> Collected:
    gravity_told = settings.gravity is not None
    constants = constants_of(settings.constants, flight, gravity=gravity_told)
    flight, constants = shaped(flight, constants, settings.resolver)
    record = bridged(_inertial(flight))
    down = None if settings.gravity is None else settings.gravity(flight)
    imu, epochs = record.imu, start_of(flight, settings.resolver, settings.false_alarm, down)
    start, losses = _keyframes(imu, epochs, causal=settings.causal)
    start, floating = _floating(start, settings, constants)
    t_s = start.t_s
    rates = Rates.of(imu, t_s, start.R_nb, start.covariance_rad2[start.told], start.own)
    antenna = antenna_motion(flight, imu, start, rates)
    sure, places_n_m = start.told & (floating.stretch < 0), _places(t_s, antenna.position)
    preintegrate, brisk = _preintegrator(flight, settings, record, start, sure, places_n_m)
    blind = (without_attitude(t_s, start.told) > LONGEST_GAP_S) | record.touched(t_s)
    fixes = (antenna.position, antenna.velocity)
    gate = gated(preintegrate, t_s, start.R_nb, fixes, blind, antenna.name, start.own)
    p_n_m, v_n_mps = _start(t_s, start.R_nb, gate.position, gate.velocity)
    slot, slot_sigma = rates.slot(imu)
    sight, sight_losses = instruments.sight(flight, imu, t_s, p_n_m)
    gravity, gravity_losses = instruments.gravity(down, t_s)
    heights, height_losses = surroundings.heights(flight, imu, t_s, p_n_m)
    field, field_losses = surroundings.magnetic_field(flight, t_s)
    offsets = with_offsets(with_evidence(constants, sight=sight is not None), heights, field)
    keyframes = Keyframes(
        t_s=t_s,
        array=replace(
            _phases(imu, start, causal=settings.causal),
            floating=floating.stretch if floating.count else None,
        ),
        R_nb=start.R_nb,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        slot=slot,
        slot_sigma=slot_sigma,
        position=gate.position,
        velocity=gate.velocity,
        gravity=gravity,
        gravity_n_mps2=preintegrate.gravity_n_mps2,
        sight=sight,
        landmark_n_m=None if sight is None or flight.seeker is None else flight.seeker.landmark_n_m,
        preintegrate=preintegrate,
        constants=tuple(sorted((*offsets, *floating.constants), key=lambda one: one.place)),
        baselines=shape_at(start.phases, start.form, t_s, start.told, constants),
        heights=heights,
        field=field,
    )
    parts = (start.losses, losses, antenna.losses, gate.losses)
    notes = (*start.notes, *brisk, *antenna.notes, *_gaps(keyframes, start.told, record.gaps_s))
    keyframes, few_notes = with_few(keyframes, antenna.few, without_attitude(t_s, start.told))
    keyframes, shared_m2 = _in_pieces(keyframes, antenna.arcs_m2, settings)
    return Collected(
        keyframes=keyframes,
        epochs=len(keyframe_times(epochs.t_s)),
        common_position_m2=antenna.common_m2 + shared_m2,
        common_velocity_m2ps2=antenna.drift_m2ps2,
        integers=start.integers,
        losses=tuple(sum((*parts, sight_losses, gravity_losses, height_losses, field_losses), ())),
        rejections=(*start.rejections, *gate.rejections),
        notes=(*notes, *floating.notes, *few_notes),
        rough=start.rough,
    )


def _in_pieces(
    keyframes: Keyframes, arcs_m2: FloatArray, settings: Settings
) -> tuple[Keyframes, FloatArray]:
    """Give stretches of positions their offsets; return what all have in common, (n, 3, 3)."""
    if keyframes.position is None:
        return keyframes, arcs_m2
    found = in_pieces(keyframes.position, arcs_m2, offsets=settings.own_factors)
    constants = sorted((*keyframes.constants, *found.constants), key=lambda one: one.place)
    keyframes = replace(keyframes, position=found.position, constants=tuple(constants))
    return keyframes, found.common_m2


def _inertial(flight: Flight) -> Imu:
    """Return the accelerometer's record, if it says anything of motion."""
    if flight.imu is None:
        raise NoSolutionError("motion: between epochs it needs an [imu], the flight has none")
    if len(flight.imu.t_s) < 2:
        raise NoSolutionError(f"motion: the [imu] has {len(flight.imu.t_s)} samples, needs 2")
    return flight.imu


def _keyframes(imu: Imu, epochs: Start, *, causal: bool) -> tuple[Start, tuple[Loss, ...]]:
    """Choose epochs, and times between them, as keyframes; count the rest with their reasons."""
    start = at_keyframes(epochs, keyframe_times(epochs.t_s))
    t_s = start.t_s
    covered = (t_s >= imu.t_s[0]) & (t_s <= imu.t_s[-1])
    good = np.flatnonzero(covered & start.told)
    if len(good) < 2:
        raise NoSolutionError(
            f"attitude: {len(good)} epochs have consistent array phases, or other vectors out of "
            f"line, to start from; needs 2 or more: {_why(imu, start, covered)}"
        )
    early = covered & (np.arange(len(t_s)) < good[0])
    reasons = {
        ("epoch", "not covered by the accelerometer's record"): ~covered,
        ("epoch", "before the first attitude"): early,
        ("array phases of an epoch", "residuals fail the chi-square test"): covered & start.refused,
    }
    losses = tuple(
        Loss(what=what, reason=reason, count=int(lost.sum()))
        for (what, reason), lost in reasons.items()
        if lost.any()
    )
    start = start[np.flatnonzero(covered & ~early)]
    fill = held_on if causal else filled
    R_nu = fill(start.t_s, start.R_nu, start.told)
    return replace(start, R_nb=spun(start.own, start.t_s, R_nu)), losses


def _places(t_s: FloatArray, position: Timed | None) -> FloatArray:
    """Return where fixes say that each keyframe is, (n, 3); gravity minds no jumps of 100 m."""
    if position is None or not np.isfinite(position.value).any():
        raise NoSolutionError("position: neither code observations nor fixes at keyframes")
    return _interpolated(t_s, position.value)


def _floating(
    start: Start, settings: Settings, constants: tuple[FlightConstant, ...]
) -> tuple[Start, Floating]:
    """Let epochs without integers tell attitudes, where the array's shape is no question."""
    if not settings.own_factors or any(one.place >= ANTENNAS for one in constants):
        return start, Floating(stretch=np.full(len(start.t_s), -1, dtype=np.int64), count=0)
    start, floating = with_float_arcs(start, settings.false_alarm, causal=settings.causal)
    if not floating.count:
        return start, floating
    fill = held_on if settings.causal else filled
    return replace(start, R_nb=fill(start.t_s, start.R_nb, start.told)), floating


def _preintegrator(
    flight: Flight,
    settings: Settings,
    record: Bridged,
    start: Start,
    sure: BoolArray,
    p_n_m: FloatArray,
) -> tuple[BridgingPreintegrator, tuple[str, ...]]:
    """Return what makes the factors between keyframes, of those in gaps, too; and what to note.

    How briskly the body turns is told by attitudes that are ``sure``, (n,): with integers.
    """
    imu, t_s, told = record.imu, start.t_s, start.told
    of_sure = (t_s[sure], start.R_nu[sure], start.covariance_rad2[sure])
    told_by = _intensity(imu, settings, *of_sure, rough=start.rough)
    usual, density = told_by.usual, told_by.at(t_s)
    unfelt = holed = record.touched(t_s)[:-1]
    if imu.w_b_radps is None:
        away_s = without_attitude(t_s, told, causal=settings.causal)
        unfelt = unfelt | (np.minimum(away_s[1:], away_s[:-1]) > LOST_S)
        gaps = density_in_gaps(t_s, start.R_nu, sure, of_sure[2], usual)
        gaps[told[1:] & told[:-1]] = usual  # phases without integers tell how it turned there
        density = np.maximum(density, gaps)
    made = BridgingPreintegrator(
        imu=imu,
        increments=increments(imu, t_s, settings.sub_steps),
        gravity_n_mps2=flight.origin.gravity_n_mps2(p_n_m),
        earth_rate_n_radps=flight.origin.earth_rate_n_radps,
        angular_acceleration_density=usual,
        loose=record.loose,
        holed=holed,
        loosened=unfelt,
        density=density,
    )
    return made, told_by.notes


def _phases(imu: Imu, start: Start, *, causal: bool) -> ArrayForm:
    """Return what the array says; without a gyroscope, next to nothing elsewhere, too."""
    form, told = start.form, start.told
    lost = (without_attitude(start.t_s, told, causal=causal) > LOST_S).any()
    if imu.w_b_radps is not None or (form is not None and not lost):
        return ArrayForm.of(form, told)
    vague = hardly_known(form, start.R_nb, start.t_s, told)
    return ArrayForm.of(vague, np.ones_like(told))


def _gaps(keyframes: Keyframes, attitude: BoolArray, inertial_s: FloatArray) -> tuple[str, ...]:
    """Tell where measurements are missing for long."""
    t_s, notes = keyframes.t_s, [*told("inertial samples", inertial_s)]
    missing = {
        "position": None if keyframes.position is None else keyframes.position.value,
        "velocity": None if keyframes.velocity is None else keyframes.velocity.value,
        "line of sight": None if keyframes.sight is None else keyframes.sight.e_b,
    }
    notes += told("attitude of single epochs", spans(t_s, ~attitude))
    for what, values in missing.items():
        if values is not None:
            notes += told(what, spans(t_s, np.isnan(values[:, 0])))
    return tuple(notes)


def _why(imu: Imu, start: Start, covered: BoolArray) -> str:
    """Return what keeps a flight from having attitudes to start from."""
    if not covered.any():
        return (
            f"no GNSS epoch lies within the accelerometer's record, {imu.t_s[0]:.3f} to "
            f"{imu.t_s[-1]:.3f} s"
        )
    if start.refused.any():
        return f"array phases contradict each other at {int(start.refused.sum())} epochs"
    if start.unobservable:
        angles = " and ".join(start.unobservable)
        return f"the array leaves {angles} open; a baseline out of line, or Doppler, would tell"
    if start.form is not None and not start.told.any():
        return "the integers of the array's phases are not fixed, or too few"
    if start.form is None and not start.told.any():
        return "with one antenna it takes Doppler or velocities, or a line of sight, to tell roll"
    return f"{int((covered & start.told).sum())} within the accelerometer's record"


def _start(
    t_s: FloatArray, R_nb: FloatArray, position: Timed | None, velocity: Timed | None
) -> tuple[FloatArray, FloatArray]:
    """Return where positions and velocities of the accelerometer start, (n, 3) each."""
    if position is None or not np.isfinite(position.value).any():
        raise NoSolutionError("position: neither code observations nor fixes at keyframes")
    p_n_m = _interpolated(t_s, position.value) - R_nb @ position.arm_b_m
    if velocity is not None and np.isfinite(velocity.value).any():
        return p_n_m, _interpolated(t_s, velocity.value)
    return p_n_m, np.gradient(p_n_m, t_s, axis=0)


def _interpolated(t_s: FloatArray, values: FloatArray) -> FloatArray:
    known = np.isfinite(values).all(axis=1)
    columns = [np.interp(t_s, t_s[known], column[known]) for column in values.T]
    return np.stack(columns, axis=1)


def _intensity(
    imu: Imu,
    settings: Settings,
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    *,
    rough: bool,
) -> Intensity:
    """Return the intensity of angular acceleration about the body axes."""
    if imu.w_b_radps is not None:
        return Intensity.steady(np.zeros(3))
    if settings.angular_acceleration_density is not None:
        return Intensity.steady(np.full(3, settings.angular_acceleration_density))
    if len(t_s) < _FEWEST:
        raise NoSolutionError(
            f"rate: {len(t_s)} epochs with an attitude are too few to tell how briskly the body "
            f"turns without a gyroscope, needs {_FEWEST}; or state angular_acceleration_density"
        )
    if rough:  # their stated covariance is a guess
        return Intensity.steady(density_of_rough_attitudes(t_s, R_nb))
    return intensity(t_s, R_nb, covariance_rad2)

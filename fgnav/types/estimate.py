"""Estimates: attitude, position, velocity, with covariance or honestly absent."""

from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Unused, freeze, freeze_times
from fgnav.geometry.rotations import euler_sigma, to_euler
from fgnav.types.flight import Flight, Truth
from fgnav.types.integers import ArcInteger, Integers
from fgnav.types.summaries import summary, summary_html

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

_MOTION_VECTORS = (
    "p_n_m",
    "v_n_mps",
    "angular_rate_b_radps",
    "accelerometer_bias_mps2",
    "gyroscope_bias_radps",
)
_MOTION_MATRICES = (
    "position_covariance_m2",
    "velocity_covariance_m2ps2",
    "accelerometer_bias_covariance_m2ps4",
    "gyroscope_bias_covariance_rad2ps2",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejected:
    """A measurement that an estimator mended, or did not believe, over a span of time.

    Attributes
    ----------
    what : str
        The kind of measurement: ``"phase"``, ``"position"``.
    link : str
        Who measured it: ``"a3 G05 1C"``, ``"a1"``.
    from_s, until_s : float
        First and last epoch.
    reason : str
        What was wrong with it, and what was done.
    """

    what: str
    link: str
    from_s: float
    until_s: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A sensor whose innovations leave the band of its noise: when, by how much, by which test.

    Attributes
    ----------
    sensor : str
        As in ``Consistency.what``, or the sensor of an inertial unit.
    from_s, until_s : float
        First and last measurement concerned.
    ratio : float
        Variance of innovations over what noise explains; of a correlation, that itself.
    limit : float
        The largest ratio that is no verdict.
    test : str
        ``"record"``, ``"5 s"``, ``"1 s"``, ``"correlation"`` or ``"plausibility"``.

    Examples
    --------
    >>> str(Verdict(sensor="velocity", from_s=3.0, until_s=7.0, ratio=9.0, limit=6.0, test="5 s"))
    'velocity, 3.0 to 7.0 s: innovations 3.0 x their sigma (limit 2.4 x, blocks of 5 s)'
    """

    sensor: str
    from_s: float
    until_s: float
    ratio: float
    limit: float
    test: str

    def __str__(self) -> str:
        """Return one line for a reader."""
        when = f"{self.sensor}, {self.from_s:.1f} to {self.until_s:.1f} s: "
        if self.test == "correlation":
            return when + (
                f"innovations are correlated from one to the next, {self.ratio:.2f} "
                f"(limit {self.limit:.2f}); timestamps or a systematic error"
            )
        sigmas, most = self.ratio**0.5, self.limit**0.5
        if self.test == "plausibility":
            return when + (
                f"estimated at {sigmas:.2g} x the largest plausible value; a fault is likely: "
                "axes, signs, scale, timestamps or positions"
            )
        of = "the record" if self.test == "record" else f"blocks of {self.test}"
        return when + f"innovations {sigmas:.2g} x their sigma (limit {most:.2g} x, {of})"


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSummary:
    """Factors, keyframes and solver of an estimate's factor graph.

    Attributes
    ----------
    solver : str
        ``"gtsam.IncrementalFixedLagSmoother"``.
    updates : int
        Of GTSAM's window, or iterations of a batch.
    factors : dict of str to int
        How many there are of each kind: ``{"position": 600}``.
    networks : dict of str to dict of str to int
        How often each network answered (``"answered"``), and why it did not otherwise.
    """

    solver: str
    updates: int
    factors: dict[str, int]
    networks: dict[str, dict[str, int]] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the kinds with their counts, and the solver."""
        kinds = ", ".join(f"{count} {name}" for name, count in self.factors.items())
        return f"{kinds}; {self.solver}, {self.updates} updates"


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """Agreement of one kind of measurement with the estimate made from all others.

    Attributes
    ----------
    what : str
        The kind: ``"position"``.
    count : int
        Measurements tested.
    freedom : int
        Their degrees of freedom in all.
    nis : float
        Normalised innovation squared per degree of freedom; 1 is expected.
    beyond_99 : float
        Share beyond the gate that 99 % of right measurements pass; 0.01 is expected.
    deciles : tuple of int
        How many lie between each two deciles of their chi-square distribution, ten numbers: equally
        many where the noise is what it is stated to be. Empty where that is not known.
    correlation : float or None
        Of neighbouring innovations; 0 is expected. None where that is not known.
    """

    what: str
    count: int
    freedom: int
    nis: float
    beyond_99: float
    deciles: tuple[int, ...] = ()
    correlation: float | None = None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CalibratedParameter:
    """Parameter of a whole flight that was estimated with it, as a deviation from the given value.

    Attributes
    ----------
    name : str
        ``"landmark"``, ``"boresight"``, ``"antenna a4"``.
    axes : tuple of str, length d
        What each number stands for: ``"north"``, ``"about y_b"``.
    unit : str
        ``"m"``, ``"rad"``, ``"uT"``.
    value : ndarray, shape (d,)
    covariance : ndarray, shape (d, d)
    """

    name: str
    axes: tuple[str, ...]
    unit: str
    value: FloatArray
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        d = len(self.axes)
        freeze(f"constant {self.name}", self, {"value": (d,), "covariance": (d, d)})

    def to_dict(self) -> dict[str, object]:
        """Return value and 1-sigma by axis, in plain types."""
        sigma = np.sqrt(np.diag(self.covariance)).tolist()
        return {
            "name": self.name,
            "unit": self.unit,
            "value": dict(zip(self.axes, self.value.tolist(), strict=True)),
            "sigma": dict(zip(self.axes, sigma, strict=True)),
        }


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Estimate:
    """Estimates at the epochs that have one.

    Attributes
    ----------
    method : str
        Who made it.
    t_s : ndarray, shape (n,)
        Epochs with an answer, strictly increasing.
    n_epochs : int
        How many epochs were asked for; ``n / n_epochs`` is the availability.
    R_nb : ndarray, shape (n, 3, 3)
    attitude_covariance_rad2 : ndarray, shape (n, 3, 3), or None
        Of the body-axes tangent ``R_true = R_nb @ Exp(delta)``; None where the method states none.
        A direction that the data leave open has variance pi^2 / 3, that of a uniform angle.
    p_n_m, v_n_mps : ndarray, shape (n, 3), or None
        Of the body's origin; NaN where an epoch has an attitude and no position or velocity.
    position_covariance_m2, velocity_covariance_m2ps2 : ndarray, shape (n, 3, 3), or None
    angular_rate_b_radps, accelerometer_bias_mps2 : ndarray, shape (n, 3), or None
    accelerometer_bias_covariance_m2ps4 : ndarray, shape (n, 3, 3), or None
    gyroscope_bias_radps, gyroscope_bias_covariance_rad2ps2 : ndarray or None
        Of a flight with a gyroscope, the same shapes.
    unobservable : tuple of str
        States the data do not determine, by name: ``"roll"``. Their values are conventions
        (zero), not estimates.
    converged : bool
        Whether an iterative method ended at a minimum.
    integers : Integers or None
        The integers it used, in the layout of the flight's double differences.
    arcs : tuple of ArcInteger
        Integers of arcs against a base, each with the chance that it is wrong, and its span.
    unused : tuple of Unused
        Measurements and epochs that did not take part, with the reason.
    rejections : tuple of Rejected
        Measurements that contradicted the others, each with its link and its span of time.
    consistency : tuple of Consistency
        Innovations of a method that states them, by kind of measurement.
    verdicts : tuple of Verdict
        Sensors that contradict the others, or their own noise.
    graph : GraphSummary or None
        Of methods that have one.
    calibration : tuple of CalibratedParameter
        What was estimated with the flight and holds for all of it.
    notes : tuple of str
        What a reader of the result should know, one sentence each.

    Examples
    --------
    >>> import fgnav
    >>> estimate = fgnav.Smoother(noise="nominal")(fgnav.load_flight("demo/flight"))
    >>> estimate.R_nb.shape == (len(estimate.t_s), 3, 3), estimate.converged
    (True, True)
    >>> bool((estimate.sigma_deg < 1.0).all())  # of roll, pitch and yaw
    True
    """

    method: str
    t_s: FloatArray
    n_epochs: int
    R_nb: FloatArray
    attitude_covariance_rad2: FloatArray | None = None
    p_n_m: FloatArray | None = None
    position_covariance_m2: FloatArray | None = None
    v_n_mps: FloatArray | None = None
    velocity_covariance_m2ps2: FloatArray | None = None
    angular_rate_b_radps: FloatArray | None = None
    accelerometer_bias_mps2: FloatArray | None = None
    accelerometer_bias_covariance_m2ps4: FloatArray | None = None
    gyroscope_bias_radps: FloatArray | None = None
    gyroscope_bias_covariance_rad2ps2: FloatArray | None = None
    unobservable: tuple[str, ...] = ()
    converged: bool = True
    integers: Integers | None = None
    arcs: tuple[ArcInteger, ...] = ()
    unused: tuple[Unused, ...] = ()
    rejections: tuple[Rejected, ...] = ()
    consistency: tuple[Consistency, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    calibration: tuple[CalibratedParameter, ...] = ()
    graph: GraphSummary | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        n = freeze_times(self.method, self)
        if self.n_epochs < n:
            raise BadInputError(f"{self.method} n_epochs: {self.n_epochs}, but {n} have an answer")
        freeze(self.method, self, {"R_nb": (n, 3, 3)})
        if self.attitude_covariance_rad2 is not None:
            freeze(self.method, self, {"attitude_covariance_rad2": (n, 3, 3)})
        shapes = dict.fromkeys(_MOTION_MATRICES, (n, 3, 3)) | dict.fromkeys(_MOTION_VECTORS, (n, 3))
        stated = {k: shape for k, shape in shapes.items() if getattr(self, k) is not None}
        freeze(self.method, self, stated, gaps=True)

    @property
    def available(self) -> float:
        """Share of the epochs that have an answer."""
        return len(self.t_s) / self.n_epochs if self.n_epochs else 0.0

    @property
    def consistent(self) -> bool:
        """True if no sensor contradicts the others beyond a false-alarm rate of 1 % a flight."""
        return not self.verdicts

    @property
    def euler_deg(self) -> FloatArray:
        """Roll, pitch and yaw, (n, 3), against the axes of ``n``."""
        return np.asarray(np.degrees(to_euler(self.R_nb)))

    @property
    def sigma_rad(self) -> FloatArray | None:
        """Standard deviations of roll, pitch and yaw, (n, 3); None where the method states none."""
        if self.attitude_covariance_rad2 is None:
            return None
        return euler_sigma(self.R_nb, self.attitude_covariance_rad2)

    @property
    def sigma_deg(self) -> FloatArray | None:
        """The same in degrees."""
        return None if self.sigma_rad is None else np.asarray(np.degrees(self.sigma_rad))

    @property
    def position_sigma_m(self) -> FloatArray | None:
        """Standard deviations north, east, down, (n, 3); None where the method states none."""
        return sigmas(self.position_covariance_m2)

    @property
    def velocity_sigma_mps(self) -> FloatArray | None:
        """Standard deviations north, east, down, (n, 3); None where the method states none."""
        return sigmas(self.velocity_covariance_m2ps2)

    def errors(self, truth: Truth) -> "Errors":
        """Return estimate minus truth at the epochs that this covers, with their sigmas.

        Examples
        --------
        >>> import fgnav
        >>> flight = fgnav.load_flight("demo/flight")
        >>> errors = fgnav.Smoother(noise="nominal")(flight).errors(flight.truth)
        >>> errors.euler_deg.shape == errors.sigma_deg.shape
        True
        """
        scores = import_module("fgnav.evaluation.scores")  # it knows this type, not this file it
        errors: Errors = scores.errors_against(truth, self)
        return errors

    def to_pandas(self) -> "DataFrame":
        """Return every figure as a ``pandas.DataFrame``, ``t_s`` for an index; see ``to_table``.

        Raises
        ------
        BadInputError
            If pandas is not installed.
        """
        try:
            from pandas import DataFrame  # noqa: PLC0415  # lazy: an extra
        except ModuleNotFoundError:
            raise BadInputError("to_pandas needs pandas; pip install 'fgnav[tables]'") from None
        return DataFrame(self.to_table()).set_index("t_s")

    def to_xarray(self) -> "Dataset":
        """Return every array as an ``xarray.Dataset`` over ``t_s`` and named axes.

        Raises
        ------
        BadInputError
            If xarray is not installed.
        """
        try:
            from xarray import Dataset  # noqa: PLC0415  # lazy: an extra
        except ModuleNotFoundError:
            raise BadInputError("to_xarray needs xarray; pip install 'fgnav[tables]'") from None
        from fgnav.types.estimate_table import labelled  # noqa: PLC0415  # knows this type

        arrays, axes = labelled(self)
        return Dataset(arrays, coords={"t_s": self.t_s, **axes}, attrs={"method": self.method})

    def to_table(self) -> dict[str, FloatArray]:
        """Return (n,) columns by name, every covariance in full; see ``estimate_table``."""
        from fgnav.types.estimate_table import estimate_table  # noqa: PLC0415  # knows this type

        return estimate_table(self)

    def __repr__(self) -> str:
        """Return five lines: whose it is, when, how sure, what is open."""
        return summary(self)

    def _repr_html_(self) -> str:
        """Return the summary as HTML, for a notebook."""
        return summary_html(self)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Errors:
    """Estimate minus truth at every epoch that has both.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    euler_rad : ndarray, shape (n, 3)
        Roll, pitch, yaw, wrapped; NaN in the columns of unobservable angles.
    tangent_b_rad : ndarray, shape (n, 3)
        Body-axes rotation vector from the estimated to the true attitude.
    position_n_m, velocity_n_mps : ndarray, shape (n, 3), or None
    nees, position_nees, velocity_nees : ndarray, shape (n,), or None
        Normalised errors squared of attitude, position, velocity: chi-square with 3 degrees of
        freedom when the stated covariance is right; NaN where that is not positive definite.
    sigma_rad, position_sigma_m, velocity_sigma_mps : ndarray, shape (n, 3), or None
        1-sigma as the estimate states it, at the same epochs.
    unused : tuple of Unused
        Epochs of the estimate that could not be judged.
    """

    t_s: FloatArray
    euler_rad: FloatArray
    tangent_b_rad: FloatArray
    position_n_m: FloatArray | None
    velocity_n_mps: FloatArray | None
    nees: FloatArray | None
    sigma_rad: FloatArray | None = None
    position_sigma_m: FloatArray | None = None
    velocity_sigma_mps: FloatArray | None = None
    position_nees: FloatArray | None = None
    velocity_nees: FloatArray | None = None
    unused: tuple[Unused, ...] = ()

    @property
    def euler_deg(self) -> FloatArray:
        """Roll, pitch and yaw, (n, 3)."""
        return np.asarray(np.degrees(self.euler_rad))

    @property
    def sigma_deg(self) -> FloatArray | None:
        """1-sigma of roll, pitch and yaw, (n, 3)."""
        return None if self.sigma_rad is None else np.degrees(self.sigma_rad)

    def __repr__(self) -> str:
        """Return the number of judged epochs and the RMS errors of the angles."""
        shown = ", ".join(f"{rms:.3f}" for rms in np.sqrt((self.euler_deg**2).mean(axis=0)))
        return f"<Errors: {len(self.t_s)} epochs, RMS of roll, pitch, yaw {shown} deg>"


class Estimator(Protocol):
    """Anything that turns a flight into an estimate."""

    @property
    def name(self) -> str:
        """Short label, as the command line and the reports know it."""
        ...

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate; raise ``NoSolutionError`` when the flight has no answer for this method."""
        ...


def sigmas(covariance: FloatArray | None) -> FloatArray | None:
    """Return the standard deviations (n, 3) of covariances (n, 3, 3)."""
    if covariance is None:
        return None
    return np.asarray(np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0)))


def open_angle_variance_rad2() -> float:
    """Return the variance of an angle of which nothing is known: uniform over the circle."""
    return float(np.pi**2 / 3)

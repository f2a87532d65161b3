"""Manifest of a network that measures: the TOML or JSON file beside its ONNX file."""

from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import msgspec
import numpy as np

from fgnav.checks import BoolArray, FloatArray, quoted
from fgnav.io.atomic_write import write_text
from fgnav.io.strict_toml import NotNegative, Positive, Table, as_table, read_toml_or_json
from fgnav.neural.measures import MEASURES, SENSORS, Form, Measure, Quantity

FORMAT: Literal["fgnav-factor/1"] = "fgnav-factor/1"
UNKNOWN = "unknown"
_HEX = r"^[0-9a-f]{64}$"
_ROUNDING = 1e-9  # of a range: figures of files are rounded

Text: TypeAlias = Annotated[str, msgspec.Meta(min_length=1)]
Window: TypeAlias = Annotated[int, msgspec.Meta(ge=1, le=100_000)]
Share: TypeAlias = Annotated[float, msgspec.Meta(ge=0, lt=1)]


class Input(Table, frozen=True):
    """One input of the network: a window of the newest samples of a sensor, oldest first.

    Attributes
    ----------
    name : str
        Of the ONNX graph's input, of shape (n, window, channels), float32; axes of length one may
        be left out.
    sensor : str
        ``"accelerometer"``, ``"gyroscope"``, ``"magnetometer"``, ``"barometer"``, ``"position"``,
        ``"velocity"``, or the name of a ``Record`` that the factor is given; of integers what their
        resolver gives.
    unit, frame : str
        Of its samples, as the flight has them: nothing is converted.
    rate_hz : float
        That the network was trained at; 0 of an epoch by itself.
    window : int
        Samples.
    mean, scale : tuple of float
        By channel: the network is given ``(x - mean) / scale``.
    range : tuple of (float, float)
        By channel, in the unit: what training has seen. The factor leaves where a sample is beyond.
    """

    name: Text
    sensor: Text
    unit: Text
    frame: Text
    rate_hz: NotNegative
    window: Window
    mean: tuple[float, ...]
    scale: tuple[Positive, ...]
    range: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        """Check unit, frame and channels against the sensor's."""
        sensor = SENSORS.get(self.sensor)
        channels = len(self.range) if sensor is None else sensor.channels
        if sensor is not None:
            _one_of("unit", self.unit, (sensor.unit,), f"the unit of a flight's {self.sensor}")
            _one_of("frame", self.frame, (sensor.frame,), f"the frame of a flight's {self.sensor}")
        for key in ("mean", "scale", "range"):
            if len(getattr(self, key)) != channels or not channels:
                raise ValueError(
                    f"{key}: must have {max(channels, 1)} entries, one per channel of "
                    f"{self.sensor}, has {len(getattr(self, key))}"
                )
        for low, high in self.range:
            if not low < high:
                raise ValueError(f"range: each must be [low, high], low first, got [{low}, {high}]")

    def inside(self, values: FloatArray) -> BoolArray:
        """Return the mask, (k, channels), of windows, (k, window, channels), all in range."""
        low, high = np.array(self.range).T
        return np.asarray(((values >= low) & (values <= high)).all(axis=1))


class Statistic(Table, frozen=True):
    """A figure of its inputs, and what of it training has seen.

    Attributes
    ----------
    name : str
        Of the ONNX graph's output, (n,) or (n, 1) float32, or of what a resolver of integers
        computes of an epoch; in reports without its underscores.
    unit : str
        Of that, for people.
    range : (float, float)
        The factor leaves, and integers are left to others, where it is beyond.
    """

    name: Text
    unit: Text
    range: tuple[float, float]

    def __post_init__(self) -> None:
        """Check that the range is one."""
        low, high = self.range
        if low > high:
            raise ValueError(f"range: must be [low, high], low first, got [{low}, {high}]")

    def holds(self, figure: FloatArray) -> BoolArray:
        """Return the mask of figures within the range, up to rounding."""
        low, high = self.range
        slack = _ROUNDING * max(abs(low), abs(high))
        return np.asarray((figure >= low - slack) & (figure <= high + slack))

    @property
    def beyond(self) -> str:
        """Reason for figures outside the range: ``"misfit outside 0.62 to 2.34"``."""
        low, high = self.range
        unit = f" {self.unit}" if self.unit != "1" else ""
        return f"{self.name.replace('_', ' ')} outside {low:.4g} to {high:.4g}{unit}"


class Covariance(Table, frozen=True):
    """Covariance of the output, as the network states it.

    Attributes
    ----------
    form : {"log_sigma", "cholesky", "none", "probability", "posterior"}
        ``log_sigma``: natural logarithms of the 1-sigmas of each axis of the tangent, or one for
        all. ``cholesky``: lower triangle L of ``L L'``, row by row, its diagonal positive.
        ``none``: the network states nothing, ``sigma`` does, of integers nothing. Of integers,
        ``probability``: of each to be right. ``posterior``: the output is no integers but, of
        candidates that a search has found, exponents of their posterior; ``name`` is that of none
        of an epoch's to be right.
    name : str
        Of the ONNX graph's output; of forms other than none.
    sigma : tuple of float
        1-sigmas, each or one for all, in the output's unit; of the form none.
    """

    form: Form
    name: str = ""
    sigma: tuple[Positive, ...] = ()

    def __post_init__(self) -> None:
        """Check that each form has what it needs, and nothing else."""
        if self.form == "none" and self.name:
            raise ValueError("name: form none has no output of the graph; leave it out")
        if self.form != "none" and (self.sigma or not self.name):
            raise ValueError(
                f"name: form {self.form} needs the name of the graph's output, and no sigma"
            )


class Output(Table, frozen=True):
    """Quantity that the network measures at the time of its newest samples.

    Attributes
    ----------
    name : str
        Of the ONNX graph's output, (n, d) float32: an angle, or its cosine and sine; a rotation
        matrix row by row, or a quaternion wxyz, of ``R_nb``; a vector; a number.
    measures : str
        Heading of ``x_b``; attitude; direction of gravity; velocity, speed, height above the
        origin, position, and displacement over ``over_s``, of the accelerometer; the integers of an
        array's double differences.
    manifold, unit, frame : str
        As ``measures`` has them. A displacement in ``b`` is in body axes at its beginning.
    covariance : Covariance
    half_life_s : float
        After which errors of two outputs, less what lasts, are correlated by a half; 0 of
        independent ones.
    lasting : float
        Share of the errors' variance that lasts as long as a flight, in the tangent's axes.
    over_s : float or None
        Of displacements.
    """

    name: Text
    measures: Quantity
    manifold: Text
    unit: Text
    frame: Text
    covariance: Covariance
    half_life_s: NotNegative
    lasting: Share = 0.0
    over_s: Positive | None = None

    def __post_init__(self) -> None:
        """Check manifold, unit and frame against what is measured."""
        what = self.measure
        _one_of("manifold", self.manifold, (what.manifold,), f"the manifold of {self.measures}")
        _one_of("unit", self.unit, tuple(what.units), f"a unit of {self.measures}")
        _one_of("frame", self.frame, what.frames, f"a frame of {self.measures}")
        if (self.over_s is None) == (self.measures == "displacement"):
            raise ValueError("over_s: goes with displacement, and only then")
        form, sigmas = self.covariance.form, len(self.covariance.sigma)
        _one_of("covariance.form", form, what.forms, f"a form of {self.measures}")
        if what.freedom and form == "none" and not sigmas:
            raise ValueError("covariance.sigma: form none needs sigma; add it")
        if sigmas not in {0, 1, what.freedom} or (sigmas and not what.freedom):
            wanted = f"1 or {what.freedom} entries" if what.freedom else "none, of integers"
            raise ValueError(f"covariance.sigma: must have {wanted}, has {sigmas}")
        if not what.freedom and (self.half_life_s or self.lasting):
            raise ValueError("half_life_s: must be 0 of integers, an epoch of which is by itself")

    @property
    def measure(self) -> Measure:
        """Definition of the quantity."""
        return MEASURES[self.measures]

    @property
    def in_si(self) -> float:
        """The output's unit in SI or radians."""
        return self.measure.units[self.unit]


class Origin(Table, frozen=True):
    """Provenance of a network: recipe, seed, metrics, software.

    Attributes
    ----------
    recipe : dict
        Of its training, whole.
    seed : int
        Of data and training.
    metrics : dict of str to float
        Measured on data that it never saw; a name says the unit and the set.
    made_with : dict of str to str
        Versions and hardware.
    command, commit, scale : str
        That trained it, of what source, how large; ``"unknown"`` where no record was kept.
    """

    recipe: dict[str, Any]
    seed: int
    metrics: dict[str, float]
    made_with: dict[str, str]
    command: Text = UNKNOWN
    commit: Text = UNKNOWN
    scale: Text = UNKNOWN


class Manifest(Table, frozen=True):
    """The contract of a network that measures states or integers.

    Attributes
    ----------
    name : str
        What reports call its factors.
    purpose : str
        One sentence.
    onnx : str
        Name of the ONNX file, in the manifest's folder.
    sha256 : str
        Of that file; any other is refused.
    licence : str
        Of the weights: ``"BSD-3-Clause"``.
    inputs : tuple of Input
    output : Output
    domain : tuple of Statistic
        Where else than within its inputs' ranges it may be believed.
    origin : Origin or None
        Nothing that runs it reads this.
    """

    format: Literal["fgnav-factor/1"]
    name: Text
    purpose: Text
    onnx: Text
    sha256: Annotated[str, msgspec.Meta(pattern=_HEX)]
    licence: Text
    inputs: Annotated[tuple[Input, ...], msgspec.Meta(min_length=1)]
    output: Output
    domain: tuple[Statistic, ...] = ()
    origin: Origin | None = None

    def __post_init__(self) -> None:
        """Check the file's name, and that samples in time have a rate."""
        for index, spec in enumerate(self.inputs):
            if self.output.measure.freedom and not spec.rate_hz:
                raise ValueError(
                    f"inputs[{index}].rate_hz: must be above 0 of a network that measures "
                    f"{self.output.measures}, got 0"
                )
        if Path(self.onnx).name != self.onnx or not self.onnx.endswith(".onnx"):
            raise ValueError(
                f"onnx: must be the name of an .onnx file in the manifest's folder, got "
                f"{quoted(self.onnx)}"
            )

    def outputs(self) -> list[tuple[str, str]]:
        """Return key and name of each output of the graph: the answer's, then the domain's."""
        output = self.output
        named = [("output.name", output.name), ("output.covariance.name", output.covariance.name)]
        if output.measure.freedom:  # what a resolver computes of an epoch is none
            named += [
                (f"domain[{index}].name", statistic.name)
                for index, statistic in enumerate(self.domain)
            ]
        return [(key, name) for key, name in named if name]


def read_manifest(path: Path | str) -> Manifest:
    """Read a manifest from a TOML or JSON file.

    Parameters
    ----------
    path : Path or str
        JSON if the name ends in ``.json``.

    Returns
    -------
    Manifest

    Raises
    ------
    BadInputError
        If the file cannot be read or breaks the contract: one line with file, key and mend.
    """
    path = Path(path)
    return as_table(path, read_toml_or_json(path), Manifest)


def save_manifest(manifest: Manifest, path: Path | str) -> None:
    """Write a manifest as indented JSON.

    Parameters
    ----------
    manifest : Manifest
    path : Path or str

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    text = msgspec.json.format(msgspec.json.encode(manifest), indent=2).decode() + "\n"
    write_text(Path(path), text)


def _one_of(key: str, value: str, allowed: tuple[str, ...], why: str) -> None:
    if value not in allowed:
        raise ValueError(f"{key}: must be {' or '.join(allowed)}, {why}, got {quoted(value)}")

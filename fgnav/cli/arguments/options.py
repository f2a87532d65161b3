"""Options that several commands share, with their help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

IntegersName = Annotated[
    str,
    Parameter(
        help="Who resolves the integers: rounding, lambda, constrained, lambda-arcs, "
        "constrained-arcs, truth, or an installed resolver such as network or network-arcs."
    ),
]
TimesFile = Annotated[
    Path | None, Parameter(help="Estimate at the times of this CSV, column t_s, of the flight.")
]
RateHz = Annotated[
    float | None, Parameter(help="Estimate this many times a second, between epochs, too.")
]
FromSeconds = Annotated[
    float | None,
    Parameter(name="--from", help="Use what was measured from this time of the flight on, s."),
]
UntilSeconds = Annotated[
    float | None, Parameter(help="Use what was measured until this time of the flight, s.")
]
WithoutKinds = Annotated[
    str,
    Parameter(
        help="Run each method also without these, one after another: baselines (of the array and "
        "of receivers), phase, doppler, gnss, fixes, gyroscope, inertial, line-of-sight, "
        "barometer, magnetometer, vehicle, networks (of flight.toml), gravity (of networks, of "
        "--gravity), separated by commas; phase+doppler leaves both out together."
    ),
]
ReportFile = Annotated[
    Path | None,
    Parameter(
        help="Report into this file: .html, one page that needs no network; .pdf, the same on "
        "sheets; .png, the summary, and a picture of each other part beside it."
    ),
]


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class SmootherOptions:
    """Options of smoothers as text: each field is an option of its name."""

    gravity: Annotated[
        str | None,
        Parameter(
            help="Source of gravity of smoothers and closed forms: low-dynamics, or an installed "
            "one."
        ),
    ] = None
    calibrate: Annotated[
        str,
        Parameter(
            help="What the smoother estimates with the flight: landmark, boresight, gravity, "
            "lever-arm, antennas or antenna:NAME, clock (of the inertial unit), velocity-delay (of "
            "fixes), separated by commas; landmark=30 states a 1-sigma, m, deg or s."
        ),
    ] = ""
    lag: Annotated[
        float | None,
        Parameter(
            help="How long the smoother's window waits for what comes after a keyframe, s; its own "
            "default is 5."
        ),
    ] = None
    factors: Annotated[
        str,
        Parameter(
            help="Custom factors and networks of the smoother, by commas: installed sources by "
            "name, networks by their manifests, .toml or .json; none leaves out the gravity "
            "network, too, which flights without gyroscope and array have by default."
        ),
    ] = ""
    causal: Annotated[
        bool,
        Parameter(help="Let the smoother know nothing beyond its lag, settings included."),
    ] = False
    noise: Annotated[
        str | None,
        Parameter(
            help="Noise of the smoother: estimated from the flight, with clock and latency (its "
            "default), or nominal, as given."
        ),
    ] = None
    strict: Annotated[
        bool,
        Parameter(help="Exit with status 1 if measurements contradict each other."),
    ] = False


SMOOTHER_DEFAULTS = SmootherOptions()

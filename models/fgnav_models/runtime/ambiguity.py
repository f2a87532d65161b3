"""The source paper's ambiguity networks as resolvers, which every method takes."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.integers.acceptance import not_fixed, phase_links
from fgnav.neural.integers import integer_answers
from fgnav.neural.measures import Sensor
from fgnav.neural.network import Network
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers
from fgnav_models.features import ambiguity_inputs, by_elevation, wrapped
from fgnav_models.runtime.load import for_resolver

_SATELLITES = 6
# The source paper's array (its section 2.3.2), antennas 2 to 8 from the first.
_BASELINES_B_M = np.array(
    [
        [0.0, 0.1, 0.0],
        [0.0, -0.1, 0.0],
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [-0.8, 0.1, 0.1],
        [-0.8, -0.1, 0.1],
        [-0.8, 0.0, -0.1],
    ]
)
_ELSEWHERE_M = 1e-3  # an antenna further off than surveys are wrong is another array
# Double-differenced ranges and the dilution of precision, ``fgnav_models.features``.
GIVEN = {"double differences": Sensor("cycle", "none", 36)}
_FORMS = {"probability", "none"}
_FIGURES = {"antennas", "satellites", "range_noise_m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class AmbiguityNetwork:
    """A network that says how many whole wavelengths a double-differenced range holds.

    It knows GPS 1C, the source paper's eight antennas and epochs of six satellites, all tracked by
    all antennas; other links are not fixed. It is a quantiser of the range: where that is stated to
    have more than millimetres of noise, its integers would be wrong, and are not fixed. Where a
    double difference is near half a cycle, phase and range may round to different sides, and then
    the integer is wrong however well the network answers.
    """

    # a released network, ``"ambiguity-classification"`` or ``"ambiguity-regression"``
    network: str = "ambiguity-classification"
    # integers that the network itself holds less likely are not fixed; 0 takes all
    probability_min: float = 0.0

    def __post_init__(self) -> None:
        """Reject what is no probability."""
        if not 0.0 <= self.probability_min < 1.0:
            raise BadInputError(
                f"{self.network} probability_min: must be from 0 up to, and without, 1, "
                f"got {self.probability_min}"
            )

    @property
    def name(self) -> str:
        """Return the name the command line knows."""
        return self.network

    @property
    def looks_ahead(self) -> bool:
        """Return that each epoch is classified by itself."""
        return False

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve the epochs that the network knows.

        Raises
        ------
        BadInputError
            If the array is not the network's, the network's files are bad, or it states no
            probabilities and some are asked.
        """
        _check_array(self.network, differences.baselines_b_m, flight)
        network = _loaded(self.network)
        links = phase_links(differences)
        signal = _of_signal(differences)
        complete = _whole(differences, signal)
        noise = next(figure for figure in network.manifest.domain if figure.name == "range_noise_m")
        precise = noise.holds(np.sqrt(differences.code_variance_m2))
        in_domain = complete & (precise | ~signal).all(axis=1)
        cycles, sure = np.zeros(links.shape, dtype=np.int64), np.zeros(links.shape, dtype=np.bool_)
        if in_domain.any():
            order = _order(differences, signal)[in_domain]
            answers, accepted = self._answers(
                network, differences, np.flatnonzero(in_domain), order
            )
            _put(cycles, in_domain, order, answers)
            _put(sure, in_domain, order, accepted)
        fixed = links & sure
        six, exact = (figure[:, None, None] & signal for figure in (complete, in_domain))
        return Integers(
            resolver=self.name,
            cycles=np.where(fixed, cycles, 0),
            fixed=fixed,
            ratio=np.full(links.shape[:2], np.nan),
            unused=not_fixed(
                {
                    f"not GPS 1C, all that network {self.network} knows": links & ~signal,
                    f"network {self.network} wants six satellites, tracked by all antennas": (
                        links & signal & ~six
                    ),
                    f"{noise.beyond}, network {self.network}'s training domain": links
                    & six
                    & ~exact,
                    f"probability below {self.probability_min:g}": links & exact & ~sure,
                }
            ),
        )

    def _answers(
        self, network: Network, differences: DoubleDifferences, rows: IntArray, order: IntArray
    ) -> tuple[IntArray, BoolArray]:
        """Return cycles in the phases of whole epochs, (k, b, 6), and which are accepted."""
        wavelength_m = differences.wavelength_m[order[0, 0]]
        baselines = len(_BASELINES_B_M)
        shape = (len(rows), baselines, _SATELLITES - 1)
        at = order[:, None]
        code_m = np.take_along_axis(differences.code_m[rows], at, axis=2)[..., 1:]
        phase_m = np.take_along_axis(differences.phase_m[rows], at, axis=2)[..., 1:]
        features = ambiguity_inputs(
            ("range", "constellation"),
            range_cycles=code_m.reshape(len(rows), -1) / wavelength_m,
            phase_cycles=np.zeros((len(rows), baselines * (_SATELLITES - 1))),
            e_n=np.take_along_axis(differences.e_n[rows], order[..., None], axis=1),
            t_s=differences.t_s[rows],
        )
        answers = integer_answers(network, [features[:, None]])
        if self.probability_min and answers.sure is None:
            raise BadInputError(
                f"{self.network} probability_min: the network states no probabilities; take 0"
            )
        _, taken = wrapped(phase_m / wavelength_m)
        cycles = taken - np.rint(answers.value).astype(np.int64).reshape(shape)
        probability = np.ones(shape) if answers.sure is None else answers.sure.reshape(shape)
        accepted = (probability >= self.probability_min) & answers.within[:, None, None]
        of_reference = ((0, 0), (0, 0), (1, 0))
        return np.pad(cycles, of_reference), np.pad(accepted, of_reference)


def classification() -> AmbiguityNetwork:
    """Integers by a network that classifies them, epoch by epoch."""
    return AmbiguityNetwork()


def regression() -> AmbiguityNetwork:
    """Integers by a network that estimates them as numbers, epoch by epoch."""
    return AmbiguityNetwork(network="ambiguity-regression")


@cache
def _loaded(network: str) -> Network:
    return for_resolver(network, GIVEN, _FORMS, _FIGURES)


def _check_array(network: str, baselines_b_m: FloatArray, flight: Flight) -> None:
    """Raise unless the antennas stand where the network saw them."""
    same = baselines_b_m.shape == _BASELINES_B_M.shape
    if not (same and np.abs(baselines_b_m - _BASELINES_B_M).max() < _ELSEWHERE_M):
        raise BadInputError(
            f"flight {flight.name}: integers {network!r} are of a network that knows the source "
            "paper's eight antennas in their order, and no others; take 'constrained'"
        )


def _of_signal(differences: DoubleDifferences) -> BoolArray:
    """Return the mask of channels of the network's signal, (m,)."""
    channels = zip(differences.satellites, differences.signals, strict=True)
    return np.array([(satellite[0], signal) == ("G", "1C") for satellite, signal in channels])


def _whole(differences: DoubleDifferences, signal: BoolArray) -> BoolArray:
    """Return the epochs, (n,), in which all antennas track six satellites and there are no more."""
    both = np.isfinite(differences.code_m) & np.isfinite(differences.phase_m) & signal
    used = np.isfinite(differences.elevation_rad) & signal
    return np.asarray(
        (used.sum(axis=1) == _SATELLITES) & (both.sum(axis=2) == _SATELLITES).all(axis=1)
    )


def _order(differences: DoubleDifferences, signal: BoolArray) -> IntArray:
    """Return each epoch's first six channels of the signal by falling elevation, (n, 6)."""
    return by_elevation(np.where(signal, differences.elevation_rad, np.nan))[:, :_SATELLITES]


def _put(
    links: IntArray | BoolArray, whole: BoolArray, order: IntArray, values: IntArray | BoolArray
) -> None:
    """Write what is known of whole epochs, in the network's order, into all links (n, b, m)."""
    whole_links = links[whole]
    np.put_along_axis(whole_links, order[:, None], values, axis=2)
    links[whole] = whole_links

"""Compare learned weights of GNSS links: ``python docs/link_weights.py SHARED``.

The library weighs links by elevation; the study puts the answers of networks in its place, on
simulated flights that taught nothing, and on two antennas of Wettzell, whose data are in SHARED. It
writes evidence/link_weights.csv. Half an hour of one core.
"""

import csv
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
import torch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import fgnav  # noqa: E402
from docs.link_network import (  # noqa: E402
    SEED,
    LinkNet,
    Sample,
    columns,
    drawn,
    flown,
    link_inputs,
    mean_of,
    trained,
)
from fgnav.assembly.position import by_observations  # noqa: E402
from fgnav.checks import FgnavError, FloatArray  # noqa: E402
from fgnav.evaluation.figures import (  # noqa: E402
    energy_score,
    flight_figures,
    negative_log_likelihood,
)
from fgnav.evaluation.paired import pooled  # noqa: E402
from fgnav.evaluation.reference import common_epochs  # noqa: E402
from fgnav.gnss import difference  # noqa: E402
from fgnav.gnss.difference import double_differences  # noqa: E402
from fgnav.gnss.single_differences import SingleDifferences, single_differences  # noqa: E402
from fgnav.gnss.undifferenced import Undifferenced, undifferenced  # noqa: E402
from fgnav.integers.resolvers.constrained import Constrained  # noqa: E402
from fgnav.io.flight.folder import load_flight  # noqa: E402
from tests.integers.wettzell import of_signals, right_cycles, write_flight  # noqa: E402

TRAINING, HELD_OUT = 300, 12  # flights to learn from, and to compare by
THROUGH = 0.3  # weight of an attitude's likelihood beside that of a link
DB = 20 / np.log(10)  # of an echo's amplitude, while it is small
BASELINES = {"constant": "constant factors", "cn0": "C/N0 about its line"}
ENDS = {"": "value", "_low": "low", "_high": "high"}  # of an interval
MASKS_DEG = (10, 20, 30)  # of Wettzell
SIGNALS = ({"G1"}, {"G1", "E1"}, {"G1", "E1", "C2"})
Links = tuple[FloatArray, FloatArray]  # factors of standard deviations, code and phase, (n, a, m)
Weights = Callable[[fgnav.Flight, SingleDifferences], Links]


def by_elevation(_: fgnav.Flight, single: SingleDifferences) -> Links:
    """Return the library's own weights."""
    return (np.ones(single.code_there.shape),) * 2


def by_network(net: LinkNet) -> Weights:
    """Return the weights that a network states."""

    def weights(flight: fgnav.Flight, single: SingleDifferences) -> Links:
        inputs, present = link_inputs(flight, single)
        with torch.no_grad():
            factors = net(torch.tensor(inputs)).exp().numpy()
        code, phase = np.moveaxis(np.where(present[..., None], factors, np.nan), -1, 0)
        return code, phase

    return weights


def by_cn0(deviation: int) -> Weights:
    """Return weights without anything learned, by one of the inputs that are deviations of C/N0.

    An echo of amplitude a changes C/N0 by ``DB a cos(theta)`` and the phase by ``a sin(theta)``
    rad: over all theta one RMS gives the other.
    """

    def weights(flight: fgnav.Flight, single: SingleDifferences) -> Links:
        inputs, present = link_inputs(flight, single)
        echo_m = single.wavelength_m / (2 * np.pi) * inputs[..., deviation] / DB
        phase = np.sqrt(1 + echo_m**2 / single.phase_variance_m2[:, None])
        return np.where(present, 1.0, np.nan), np.where(present, phase, np.nan)

    return weights


@contextmanager
def weighing(weights: Weights) -> Iterator[None]:
    """Weigh links of the array, and those of its first antenna, otherwise than by elevation."""

    def array(flight: fgnav.Flight, *, causal: bool = False) -> SingleDifferences:
        single = single_differences(flight, causal=causal)
        factors = weights(flight, single)
        for kind, factor in zip(("code", "phase"), factors, strict=True):
            square = mean_of(factor**2, 1)[:, 0]
            getattr(single, f"{kind}_variance_m2")[:] *= np.where(square > 0, square, 1.0)
        return single

    def antenna(flight: fgnav.Flight, *, base: bool = False) -> Undifferenced:
        raw, single = undifferenced(flight, base=base), single_differences(flight)
        here, changed = columns(flight, raw), {}
        for kind, factor in zip(("code", "phase"), weights(flight, single), strict=True):
            every = np.ones(flight.observations.code_m[:, 0].shape)
            first = factor[:, 0]
            every[:, columns(flight, single)] = np.where(np.isfinite(first), first, 1.0)
            changed[f"{kind}_sigma_m"] = getattr(raw, f"{kind}_sigma_m") * every[:, here]
        return replace(raw, **changed)

    with (
        patch.object(difference, "single_differences", array),
        patch.object(by_observations, "undifferenced", antenna),
    ):
        yield


@dataclass(frozen=True, slots=True, kw_only=True)
class Weighed:
    """A smoother whose links are weighed in a way of its own."""

    name: str
    weights: Weights
    method: fgnav.Smoother = field(default_factory=lambda: fgnav.Smoother(noise="nominal"))

    def __call__(self, flight: fgnav.Flight) -> fgnav.Estimate:
        """Estimate a copy of the flight, whose differences are not known yet."""
        with weighing(self.weights):
            return self.method(replace(flight))


def figures_of(flight: fgnav.Flight, methods: list[Weighed]) -> dict[str, dict[str, float]]:
    """Return the figures of methods that have an answer, with proper scores of the position."""
    comparison = fgnav.compare(flight, methods)
    out = flight_figures(comparison)
    for one in comparison.solved:
        rows = common_epochs(one.estimate.t_s, one.errors.t_s)[0]
        covariance = one.estimate.position_covariance_m2[rows]
        error = one.errors.position_n_m
        out[one.name]["position_nll"] = negative_log_likelihood(error, covariance)
        out[one.name]["position_energy_score_m"] = energy_score(error, covariance)
    return {one.name: out[one.name] for one in comparison.solved}


def rows_of(flights: list[dict[str, dict[str, float]]]) -> Iterator[dict[str, str]]:
    """Yield a row of figures for each kind of weights, and what it gains over two of them."""
    names = list(dict.fromkeys(name for one in flights for name in one))
    solved = [one for one in flights if len(one) == len(names)]
    for name in names:
        of = {key: np.array([one[name][key] for one in solved]) for key in solved[0][name]}
        count = {key: sum(of[f"integers_{key}"]) for key in ("right", "wrong", "refused")}
        figures = {
            "flights": len(solved),
            "answered": sum(name in one for one in flights),
            "fixed_percent": 100 * (1 - count["refused"] / sum(count.values())),
            "wrong": count["wrong"],
        }
        for state, unit in (("attitude", "deg"), ("position", "m")):
            rmse, energy = f"{state}_rmse_{unit}", f"{state}_energy_score_{unit}"
            rng = np.random.default_rng(SEED)
            figures[rmse] = pooled(of[rmse], rng, squared=True).value
            for key in (f"{state}_nees", f"{state}_nll", energy):
                figures[key] = of[key].mean()
            for key, (short, other) in product((f"{state}_nll", energy), BASELINES.items()):
                base = np.array([one[other][key] for one in solved])
                less = pooled(of[key] - base, rng, squared=False)
                for end, of_end in ENDS.items():
                    figures[f"{key}_less_{short}{end}"] = getattr(less, of_end)
        yield {"world": "simulated", "weights": name} | {k: f"{v:.4g}" for k, v in figures.items()}


def wettzell_rows(shared: Path, methods: list[Weighed]) -> Iterator[dict[str, str]]:
    """Yield how many epochs of two real antennas are fixed, one by one, and how many wrongly."""
    with TemporaryDirectory() as folder:
        flight = load_flight(write_flight(Path(folder), shared))
    for method in methods:
        fixed = []
        with weighing(method.weights):
            whole = double_differences(replace(flight))
        for signals, mask_deg in product(SIGNALS, MASKS_DEG):
            integers = Constrained()(of_signals(whole, signals, mask_deg), flight)
            of_fixed = np.where(integers.fixed, whole.code_m, np.nan)
            right = right_cycles(replace(whole, code_m=of_fixed), integers.cycles)
            fixed.append([integers.fixed.any(axis=(1, 2)), right])
        accepted, right = np.concatenate(fixed, axis=1)
        figures = {"fixed_percent": 100 * accepted.mean(), "wrong": (accepted & ~right).sum()}
        yield {
            "world": "Wettzell",
            "weights": method.name,
            **{key: f"{value:.4g}" for key, value in figures.items()},
        }


def main(shared: Path) -> None:
    """Train, compare on held-out flights, and write the rows."""
    samples = []
    for k in range(TRAINING):
        try:
            samples.append(Sample.drawn([SEED, 0, k]))
        except FgnavError as error:  # a sky of too few satellites
            sys.stderr.write(f"training flight {k}: {error}\n")
    constant = trained(samples, through=THROUGH, blind=True)
    alone, through = (trained(samples, through=weight) for weight in (0.0, THROUGH))
    methods = [
        Weighed(name=name, weights=weights)
        for name, weights in {
            "elevation": by_elevation,
            BASELINES["constant"]: by_network(constant),
            BASELINES["cn0"]: by_cn0(1),
            "C/N0 between antennas": by_cn0(2),
            "network, trained alone": by_network(alone),
            "network, through the attitude": by_network(through),
        }.items()
    ]
    flights = []
    for k in range(HELD_OUT):
        seed = [SEED, 1, k]
        flight = flown(drawn(np.random.default_rng(seed)), seed)
        try:
            flights.append(figures_of(flight, methods))
        except FgnavError as error:
            sys.stderr.write(f"flight {k}: {error}\n")
    rows = [*rows_of(flights), *wettzell_rows(shared, methods)]
    path = ROOT / "docs" / "evidence" / "link_weights.csv"
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

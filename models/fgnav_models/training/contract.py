"""Releases in recipes, and the beginnings of their manifests."""

from collections.abc import Mapping
from typing import Any

from fgnav.io.strict_toml import Table
from fgnav.neural.manifest import FORMAT, Covariance, Input, Manifest, Origin, Output, Statistic
from fgnav.neural.measures import SENSORS, Sensor

_MOST = 1e3  # of any channel of an input that states no range: the domain's figures do


class Release(Table, frozen=True):
    """Release of a network, as its recipe states it."""

    name: str
    purpose: str
    notes: dict[str, str]  # sections of the card, in Markdown
    domain: dict[str, Any]  # where the network may be believed


def factor_input(
    name: str, sensor: str, rate_hz: float, window: int, *, scale: float = 1.0
) -> Input:
    """Return an input of a sensor that flights have; its domain is stated by figures."""
    return _input(name, sensor, SENSORS[sensor], round(rate_hz, 6), window, scale)


def epoch_input(name: str, sensor: str, known: Sensor, window: int) -> Input:
    """Return an input of an epoch by itself, as a resolver of integers gives it."""
    return _input(name, sensor, known, 0.0, window, 1.0)


def integers_output(name: str, form: Covariance) -> Output:
    """Return the output of a network of integers."""
    return Output(
        name=name,
        measures="integers",
        manifold="Z",
        unit="cycle",
        frame="none",
        covariance=form,
        half_life_s=0.0,
    )


def manifest_of(
    words: Release,
    inputs: tuple[Input, ...],
    output: Output,
    domain: tuple[Statistic, ...],
    origin: Origin | None = None,
) -> Manifest:
    """Return the manifest of a network to be released, but for its file's hash."""
    return Manifest(
        format=FORMAT,
        name=words.name,
        purpose=words.purpose,
        onnx=f"{words.name}.onnx",
        sha256="0" * 64,
        licence="BSD-3-Clause",
        inputs=inputs,
        output=output,
        domain=domain,
        origin=origin,
    )


def words_and_figures(domain: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[Statistic, ...]]:
    """Return a recipe's domain in words, and its figures: one number, or a range."""
    figures = {
        name: value if isinstance(value, list) else [value, value]
        for name, value in domain.items()
        if not isinstance(value, str)
    }
    return {name: value for name, value in domain.items() if name not in figures}, tuple(
        Statistic(name=name, unit="m" if name.endswith("_m") else "1", range=(low, high))
        for name, (low, high) in figures.items()
    )


def _input(
    name: str, sensor: str, known: Sensor, rate_hz: float, window: int, scale: float
) -> Input:
    return Input(
        name=name,
        sensor=sensor,
        unit=known.unit,
        frame=known.frame,
        rate_hz=rate_hz,
        window=window,
        mean=(0.0,) * known.channels,
        scale=(scale,) * known.channels,
        range=((-_MOST, _MOST),) * known.channels,
    )

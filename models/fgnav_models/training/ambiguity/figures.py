"""Plain pictures of a campaign; matplotlib is imported when one is drawn."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.atomic_write import atomic_file

_MARKERS = "osD^vPX*"


def curves(
    path: Path,
    x: FloatArray,
    lines: Mapping[str, FloatArray],
    labels: tuple[str, str],
    *,
    levels: Mapping[str, float],
) -> None:
    """Draw a line per name over common ``x``, and dashed levels across."""
    with _axes(path, labels) as axes:
        for marker, (name, y) in zip(_MARKERS, lines.items(), strict=False):
            axes.plot(x, y, marker=marker, label=name)
        for name, level in levels.items():
            axes.axhline(level, color="0.4", linestyle="--", linewidth=0.8, label=name)
        axes.set_xticks(x)
        axes.legend()


def bars(path: Path, values: Mapping[str, float], label: str) -> None:
    """Draw one bar per name, the axis cut to where they differ."""
    with _axes(path, ("", label)) as axes:
        heights = np.array(list(values.values()), dtype=float)
        finite = heights[np.isfinite(heights)]
        axes.bar(range(len(heights)), np.nan_to_num(heights), color="#0072B2")
        axes.set_xticks(range(len(heights)), list(values), rotation=90, fontsize=7)
        if len(finite):
            margin = 0.2 * (finite.max() - finite.min()) + 1e-9
            axes.set_ylim(finite.min() - margin, finite.max() + margin)


def points(path: Path, values: Mapping[str, FloatArray], labels: tuple[str, str]) -> None:
    """Draw one marker per item and name."""
    with _axes(path, labels) as axes:
        for marker, (name, y) in zip(_MARKERS, values.items(), strict=False):
            axes.plot(np.arange(len(y)), y, linestyle="", marker=marker, markersize=4, label=name)
        axes.legend()


def counts(
    path: Path,
    values: Mapping[str, IntArray | FloatArray],
    labels: tuple[str, str],
    *,
    first: int,
) -> None:
    """Draw counts over whole numbers from ``first`` on, logarithmic; zero is left out."""
    with _axes(path, labels) as axes:
        for marker, (name, y) in zip(_MARKERS, values.items(), strict=False):
            shown = np.where(np.asarray(y) >= 1e-2, y, np.nan)
            axes.plot(first + np.arange(len(y)), shown, marker=marker, markersize=4, label=name)
        axes.set_yscale("log")
        axes.legend()


def histories(path: Path, values: Mapping[str, list[dict[str, float]]]) -> None:
    """Draw the share of wrong validation answers over the steps, one line per name."""
    with _axes(path, ("step", "wrong, %")) as axes:
        for name, history in values.items():
            x = [row["step"] for row in history]
            axes.plot(x, [row["wrong_percent"] for row in history], label=name)
        axes.set_yscale("log")
        axes.legend()


@contextmanager
def _axes(path: Path, labels: tuple[str, str]) -> Iterator[Any]:
    """Yield axes; the picture is written, whole or not at all, when they are done."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  # lazy
    from matplotlib.figure import Figure  # noqa: PLC0415  # as above

    figure = Figure(figsize=(7, 4), layout="constrained", dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.set(xlabel=labels[0], ylabel=labels[1])
    axes.grid(color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    yield axes
    with atomic_file(path) as part:
        figure.savefig(part, format="png", metadata={"Software": None})

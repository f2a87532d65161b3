"""Plain pictures of a campaign; matplotlib is imported when one is drawn."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.atomic_write import atomic_file

_MARKERS = "osD^vPX*"


def lines(
    path: Path,
    values: Mapping[str, tuple[FloatArray | IntArray, FloatArray]],
    labels: tuple[str, str],
    *,
    style: str = "-",
    log: bool = False,
    levels: Mapping[str, float] | None = None,
) -> None:
    """Draw a line, or markers alone, per name: whole x, and y; and dashed levels across."""
    with _axes(path, labels) as axes:
        for marker, (name, (x, y)) in zip(cycle(_MARKERS), values.items(), strict=False):
            axes.plot(x, y, linestyle=style, marker=marker, markersize=4, label=name)
        for name, level in (levels or {}).items():
            axes.axhline(level, color="0.4", linestyle="--", linewidth=0.8, label=name)
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set_yscale("log" if log else "linear")
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
    with atomic_file(path) as partial:
        figure.savefig(partial, format="png", metadata={"Software": None})

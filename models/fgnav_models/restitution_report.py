"""Restitution in the layout of the source paper's Tables 5 to 7, as text, as CSV, as a figure."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.scores import EULER, finite_mean
from fgnav.io.atomic_write import atomic_file, write_text
from fgnav_models.restitution import (
    AMPLITUDES_DEG,
    BY_RIGHT_INTEGERS,
    LEARNED,
    MOTIONS,
    READINGS,
    Reading,
    Run,
)

FIGURE = "restitution.png"
_FIRST_TABLE = 5  # of the source paper: roll; pitch and yaw follow
_ROWS = (*MOTIONS, "average")
_SUMMARY = "".join(
    f"{name:>8}"
    for name in (
        "roll",
        "pitch",
        "yaw",
        "mean",
        "ratio",
        "epochs",
        "fixed",
        "wrong",
        "spoilt",
        "clean",
        "seen",
    )
)
# Line style by what a method is, colour by place: Okabe and Ito's set without yellow.
_STYLES = {
    "closed form": "-",
    "closed form weighted": "-",
    "smoother": "--",
    "maximum likelihood": ":",
    "RTK": "-.",
}
_COLOURS = ("#E69F00", "#D55E00", "#CC79A7", "#56B4E9", "#009E73", "#000000", "#0072B2")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Restitution:
    """Root mean squares over seeds, and what they rest on."""

    readings: tuple[Reading, ...]
    methods: tuple[str, ...]
    amplitudes_deg: tuple[int, ...]
    # (readings, methods, motions, amplitudes, 3); roll, pitch, yaw; NaN where a method had no
    # answer with any seed
    rmse_deg: FloatArray
    # (readings, methods, 4); means over flights: of epochs with an answer, of integers fixed, of
    # wrong ones among these, of epochs with an answer that hold a wrong one
    shares: FloatArray
    # (readings, methods); RMSE over epochs without a wrong integer, mean of angles and of flights
    # that have such
    clean_deg: FloatArray
    seen_deg: FloatArray  # (readings, methods); likewise over epochs that see the landmark
    # why flights had no answer at all, by reading and method
    failures: dict[tuple[str, str], list[str]]
    seeds: int

    def table_deg(self, reading: int, method: int, angle: int) -> FloatArray:
        """Return ramp, sine and their average, (3, amplitudes + 1); last the mean of amplitudes."""
        motions = self.rmse_deg[reading, method, :, :, angle]
        rows = np.concatenate([motions, motions.mean(axis=0)[None]])
        return np.concatenate([rows, rows.mean(axis=1)[:, None]], axis=1)

    def overall_deg(self, reading: int) -> FloatArray:
        """Return each method's roll, pitch, yaw and their mean, (methods, 4)."""
        angles = self.rmse_deg[reading].mean(axis=(1, 2))
        return np.concatenate([angles, angles.mean(axis=1)[:, None]], axis=1)


def summed_up(runs: Sequence[Run]) -> Restitution:
    """Return the figures of runs; of one reading or of all, each with the same cases."""
    readings = tuple(r for r in READINGS if any(run.case.reading == r for run in runs))
    methods = tuple(dict.fromkeys(run.method for run in runs))
    amplitudes = tuple(
        a for a in AMPLITUDES_DEG if any(run.case.amplitude_deg == a for run in runs)
    )
    seeds = sorted({run.case.seed for run in runs})
    shape = (len(readings), len(methods), len(MOTIONS), len(amplitudes), len(seeds))
    rmse_deg, shares = np.full((*shape, 3), np.nan), np.full((*shape, 4), np.nan)
    clean_deg, seen_deg = np.full((2, *shape), np.nan)
    failures: dict[tuple[str, str], list[str]] = {}
    for run in runs:
        case = run.case
        at = (
            readings.index(case.reading),
            methods.index(run.method),
            MOTIONS.index(case.motion),
            amplitudes.index(case.amplitude_deg),
            seeds.index(case.seed),
        )
        rmse_deg[at], clean_deg[at], seen_deg[at] = run.rmse_deg, run.clean_deg, run.seen_deg
        shares[at] = run.available, run.fixed, run.wrong, run.spoilt
        if run.failure:
            failures.setdefault((case.reading.name, run.method), []).append(run.failure)
    return Restitution(
        readings=readings,
        methods=methods,
        amplitudes_deg=amplitudes,
        rmse_deg=np.sqrt(finite_mean(rmse_deg**2, 4)),
        shares=finite_mean(shares.reshape(*shape[:2], -1, 4), 2),
        clean_deg=finite_mean(clean_deg.reshape(*shape[:2], -1), 2),
        seen_deg=finite_mean(seen_deg.reshape(*shape[:2], -1), 2),
        failures=failures,
        seeds=len(seeds),
    )


def write_report(runs: Sequence[Run], folder: Path) -> list[str]:
    """Write tables.txt, tables.csv, runs.csv and the figure; return the summary's lines."""
    figures = summed_up(runs)
    lines = summary_lines(figures)
    write_text(folder / "tables.txt", "\n".join([*lines, "", *table_lines(figures)]) + "\n")
    write_text(folder / "tables.csv", _csv(_table_rows(figures)))
    write_text(folder / "runs.csv", _csv(_run_rows(runs)))
    save_figure(figures, folder / FIGURE)
    return lines


def summary_lines(figures: Restitution) -> list[str]:
    """Return each method's averages beside what they rest on, reading by reading."""
    width = max(len(name) for name in figures.methods)
    best = figures.methods.index(BY_RIGHT_INTEGERS)
    lines = [
        f"RMSE in degrees over the epochs with an answer, mean of {' and '.join(MOTIONS)} of "
        f"{_listed(figures.amplitudes_deg)} degrees, {figures.seeds} seeds each."
    ]
    for r, reading in enumerate(figures.readings):
        overall_deg = figures.overall_deg(r)
        lines += ["", reading.title, f"{'':{width}} {_SUMMARY}"]
        for m, name in enumerate(figures.methods):
            angles = "".join(f"{_figure(value, 3):>8}" for value in overall_deg[m])
            ratio = _figure(overall_deg[m, 3] / overall_deg[best, 3], 2)
            percents = "".join(f"{_figure(100 * share, 2):>8}" for share in figures.shares[r, m])
            some = (figures.clean_deg[r, m], figures.seen_deg[r, m])
            parts = "".join(f"{_figure(value, 3):>8}" for value in some)
            lines.append(f"{name:{width}} {angles}{ratio:>8}{percents}{parts}")
    return [*lines, "", *_legend(figures)]


def table_lines(figures: Restitution) -> list[str]:
    """Return the three tables of each reading, a row per method and motion."""
    width = max(len(name) for name in figures.methods)
    head = "".join(f"{a:>7}°" for a in figures.amplitudes_deg)
    lines: list[str] = []
    for r, reading in enumerate(figures.readings):
        for angle, name in enumerate(EULER):
            title = f"Table {_FIRST_TABLE + angle}. RMSE of {name}, degrees. {reading.title}"
            lines += [title, f"{'':{width}} {'':8}{head} average"]
            for m, method in enumerate(figures.methods):
                for row, values in zip(_ROWS, figures.table_deg(r, m, angle), strict=True):
                    shown = "".join(f"{_figure(value, 3):>8}" for value in values)
                    lines.append(f"{method if row == _ROWS[0] else '':{width}} {row:8}{shown}")
            lines.append("")
    return lines[:-1]


def save_figure(figures: Restitution, path: Path) -> None:
    """Draw the average of ramp and sine over the amplitude, a row per angle, a column per reading.

    Parameters
    ----------
    path : Path
        Ends in ``.png``; its folder exists.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  # lazy
    from matplotlib.figure import Figure  # noqa: PLC0415  # as above

    columns = len(figures.readings)
    figure = Figure(figsize=(4.2 * columns + 3, 8.5), layout="constrained", dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, columns, squeeze=False, sharex=True, sharey=True)
    for r, reading in enumerate(figures.readings):
        axes[0, r].set_title(
            f"{reading.name}\nrange {reading.code_m:g} m, phase {reading.phase_m:g} m", fontsize=9
        )
        axes[-1, r].set_xlabel("amplitude, deg")
        for angle, name in enumerate(EULER):
            axes[angle, 0].set_ylabel(f"RMSE of {name}, deg")
            for m, method in enumerate(figures.methods):
                average_deg = figures.table_deg(r, m, angle)[-1, :-1]
                axes[angle, r].plot(figures.amplitudes_deg, average_deg, **_style(m, method))
            axes[angle, r].set(yscale="log")
            axes[angle, r].grid(visible=True, color="#e6e6e6", lw=0.6)
    handles = axes[0, 0].get_lines()
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8)
    with atomic_file(path) as part:
        figure.savefig(part, format="png")


def _style(place: int, method: str) -> dict[str, Any]:
    return {
        "color": _COLOURS[place % len(_COLOURS)],
        "ls": _STYLES[method.partition(",")[0]],
        "marker": "o",
        "ms": 3,
        "lw": 3.6 - 0.25 * place,  # equal lines over each other show both
        "label": method,
    }


def _legend(figures: Restitution) -> list[str]:
    """Return what the summary's columns mean, and what had no answer."""
    learned = any(method.endswith(f", {LEARNED}") for method in figures.methods)
    missing = (
        [] if learned else [f"Integers {LEARNED!r} are left out: no such resolver is installed."]
    )
    failed = [
        f"{reading}: {method}: no answer in {len(reasons)} flights, the first: {reasons[0]}"
        for (reading, method), reasons in figures.failures.items()
    ]
    return [
        f"ratio: of the mean to that of {BY_RIGHT_INTEGERS}. epochs: % with an answer. "
        "fixed: % of the integers. wrong: % of these.",
        "spoilt: % of the answered epochs that hold a wrong integer. clean: mean RMSE over the "
        "others. seen: over those that see the landmark. –: no answer in some flights.",
        *missing,
        *failed,
    ]


def _listed(amplitudes_deg: tuple[int, ...]) -> str:
    first, last = amplitudes_deg[0], amplitudes_deg[-1]
    return f"{first}" if first == last else f"{first} to {last}"


def _figure(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if np.isfinite(value) else "–"


def _plain(value: float) -> str:
    return f"{value:.6g}" if np.isfinite(value) else ""


def _table_rows(figures: Restitution) -> list[list[str]]:
    amplitudes = [f"{a}_deg" for a in figures.amplitudes_deg]
    rows = [["reading", "angle", "method", "motion", *amplitudes, "average"]]
    for r, reading in enumerate(figures.readings):
        for angle, name in enumerate(EULER):
            for m, method in enumerate(figures.methods):
                table = figures.table_deg(r, m, angle)
                rows += [
                    [reading.name, name, method, motion, *map(_plain, values)]
                    for motion, values in zip(_ROWS, table, strict=True)
                ]
    return rows


def _run_rows(runs: Sequence[Run]) -> list[list[str]]:
    head = "reading code_m phase_m motion amplitude_deg seed method roll_deg pitch_deg yaw_deg"
    rows = [
        [*head.split(), "available", "fixed", "wrong", "spoilt", "clean_deg", "seen_deg", "failure"]
    ]
    for run in runs:
        case, reading = run.case, run.case.reading
        figures = (
            *run.rmse_deg,
            run.available,
            run.fixed,
            run.wrong,
            run.spoilt,
            run.clean_deg,
            run.seen_deg,
        )
        of_case = [f"{reading.code_m:g}", f"{reading.phase_m:g}", case.motion]
        of_case += [str(case.amplitude_deg), str(case.seed)]
        rows.append([reading.name, *of_case, run.method, *map(_plain, figures), run.failure])
    return rows


def _csv(rows: list[list[str]]) -> str:
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()

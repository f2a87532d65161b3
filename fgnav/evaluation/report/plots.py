"""A comparison as a figure: errors in time with their stated bounds, and what they amount to."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.lines import COLOURS, drawable, every, is_rough, limit, unjumped_deg
from fgnav.evaluation.scores import EULER, hidden
from fgnav.geometry import rotations
from fgnav.io.atomic_write import atomic_file, check_place
from fgnav.types.estimate import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".png", ".pdf")
_BAND_SIGMAS = 3.0
_BINS = 1200  # drawn points per line: about one per pixel of width
_STYLE: Any = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.edgecolor": "#808080",
    "axes.labelcolor": "#333333",
    "xtick.color": "#333333",
    "ytick.color": "#333333",
}


def save_figure(comparison: Comparison, path: Path) -> None:
    """Write the figure of a comparison as PNG or PDF, whole or not at all.

    With truth: errors of roll, pitch and yaw in time, the 3-sigma band of the best method that
    states one, the position error, and beside each the RMS of every method with the bound. Without:
    the angles themselves, and their differences to one of the methods.

    Parameters
    ----------
    comparison : Comparison
    path : Path
        Ends in ``.png`` or ``.pdf``; its folder exists.

    Raises
    ------
    BadInputError
        As ``check_figure``, or if no method has an estimate.
    """
    check_figure(path)
    solved = comparison.solved
    if not solved:
        raise BadInputError(f"{path}: no method has an estimate to draw")
    from matplotlib import rc_context  # noqa: PLC0415  # lazy: a third of a second
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  # as above
    from matplotlib.figure import Figure  # noqa: PLC0415  # as above

    with rc_context(_STYLE):
        judged = any(method.errors is not None for method in solved)
        has_position = judged and any(m.score.position_rmse_m is not None for m in solved)
        rows = 3 + has_position
        figure = Figure(figsize=(12, 0.9 + 2.1 * rows), layout="constrained", dpi=130)
        FigureCanvasAgg(figure)
        if judged:
            _draw_errors(figure, comparison, solved, rows)
        else:
            _draw_attitudes(figure, solved)
        title = "errors against truth" if judged else "no truth: methods against each other"
        figure.suptitle(f"{comparison.flight}: {title}", x=0.01, ha="left", fontsize=12)
        with atomic_file(path) as part:
            figure.savefig(part, format=path.suffix.lower().lstrip("."))


def check_figure(path: Path) -> None:
    """Raise unless a figure can be drawn into a file of that name.

    Raises
    ------
    BadInputError
        If the name ends in neither ``.png`` nor ``.pdf``, its folder is absent or matplotlib not
        installed.
    """
    if path.suffix.lower() not in FORMATS:
        raise BadInputError(f"{path}: a figure is PNG or PDF; end its name in .png or .pdf")
    check_place(path)
    if find_spec("matplotlib") is None:
        raise BadInputError(f"{path}: a figure needs matplotlib; pip install 'fgnav[report]'")


def _draw_errors(figure: "Figure", comparison: Comparison, solved: list[Method], rows: int) -> None:
    """Draw error in time on the left, RMS on the right, one row per angle and one for position."""
    axes = figure.subplots(rows, 2, width_ratios=(3.6, 1), squeeze=False)
    behind = sorted(solved, key=_attitude_rms_deg, reverse=True)
    styles = _styles(solved, {m.name: m.errors.euler_rad for m in behind if m.errors})
    sure = [m for m in solved if m.estimate and m.estimate.attitude_covariance_rad2 is not None]
    band = min(sure, key=_attitude_rms_deg, default=None)
    for i, name in enumerate(EULER):
        left, right = axes[i]
        for method in behind:
            if method.errors is not None and name not in _hidden(method):
                error_deg = np.degrees(method.errors.euler_rad[:, i])
                _plot(left, method.errors.t_s, error_deg, styles[method.name])
        half = limit([np.asarray(line.get_ydata()) for line in left.lines])
        left.set(ylabel=f"{name} error, deg", ylim=(-half, half))
        if band is not None and band.estimate is not None and name not in hidden(band.estimate):
            _draw_band(left, band.estimate, i, styles[band.name]["color"])
        rms = {m.name: getattr(m.score.rmse_deg, name) for m in solved}
        _draw_rms(right, rms, styles, getattr(comparison.bound, name))
    axes[0, 1].set_title("RMS, deg", fontsize=9)
    if rows > len(EULER):
        _draw_position((axes[-1, 0], axes[-1, 1]), solved, styles)
    for upper in axes[:-1, 0]:
        upper.sharex(axes[-1, 0])
        upper.tick_params(labelbottom=False)
    axes[-1, 0].set_xlabel("time, s")
    axes[-1, 0].margins(x=0.01)
    _legend(figure, axes[0, 0], solved, styles)


def _draw_position(row: Sequence["Axes"], solved: list[Method], styles: dict[str, Any]) -> None:
    """Draw the length of the position error, and its RMS."""
    left, right = row
    for method in solved:
        if method.errors is not None and method.errors.position_n_m is not None:
            error_m = np.linalg.norm(method.errors.position_n_m, axis=1)
            _plot(left, method.errors.t_s, error_m, styles[method.name])
    left.set(ylabel="position error, m", ylim=(0, None))
    _draw_rms(right, {m.name: m.score.position_rmse_m for m in solved}, styles, None)
    right.set_title("RMS, m", fontsize=9)


def _draw_attitudes(figure: "Figure", solved: list[Method]) -> None:
    """Draw the angles on the left, their differences to the surest method on the right."""
    axes = figure.subplots(3, 2, sharex=True, squeeze=False)
    estimates = {m.name: m.estimate for m in solved if m.estimate is not None}
    sure = [e for e in estimates.values() if e.attitude_covariance_rad2 is not None]
    base = min(sure, key=_claimed_variance_rad2, default=next(iter(estimates.values())))
    shared = {name: common_epochs(e.t_s, base.t_s) for name, e in estimates.items()}
    apart_rad = {
        name: rotations.wrap(
            rotations.to_euler(e.R_nb[shared[name][0]])
            - rotations.to_euler(base.R_nb[shared[name][1]])
        )
        for name, e in estimates.items()
    }
    styles = _styles(solved, apart_rad)
    for i, angle in enumerate(EULER):
        left, right = axes[i]
        for name, estimate in estimates.items():
            if angle in hidden(estimate):
                continue
            whole_deg = unjumped_deg(np.degrees(rotations.to_euler(estimate.R_nb)[:, i]))
            _plot(left, estimate.t_s, whole_deg, styles[name])
            if estimate is not base and angle not in hidden(base):
                apart_deg = np.degrees(apart_rad[name][:, i])
                _plot(right, estimate.t_s[shared[name][0]], apart_deg, styles[name])
        half = limit([np.asarray(line.get_ydata()) for line in right.lines])
        left.set(ylabel=f"{angle}, deg")
        right.set(ylabel=f"{angle} − {base.method}, deg", ylim=(-half, half))
    for bottom in axes[-1]:
        bottom.set_xlabel("time, s")
    _legend(figure, axes[1, 0], solved, styles)


def _hidden(method: Method) -> set[str]:
    return hidden(method.estimate) if method.estimate is not None else set()


def _plot(axes: "Axes", t_s: FloatArray, y: FloatArray, style: dict[str, Any]) -> None:
    """Draw a series in its style: all that matters of a line, a fair sample of dots."""
    if style["marker"]:
        sample = every(len(t_s), 2 * _BINS)
        axes.plot(t_s[sample], y[sample], **style)
    else:
        axes.plot(*drawable(t_s, y, _BINS), **style)


def _styles(solved: list[Method], deviations: dict[str, FloatArray]) -> dict[str, Any]:
    """Return how each method is drawn: lines where it changes smoothly, else dots.

    Lines through what is new at every epoch would cover each other and all that lies behind them.
    Among lines, each is thinner than those it is drawn over, so that equal ones show both.

    Parameters
    ----------
    solved : list of Method
    deviations : dict of str to ndarray, shape (n, 3)
        Each method's angles against the truth or another method, in the order of drawing.
    """
    dots = {"ls": "none", "marker": "o", "ms": 1.8, "mew": 0, "alpha": 0.7}
    smooth = [name for name, deviation in deviations.items() if not is_rough(deviation)]
    widths = dict(zip(reversed(smooth), (1.0, 2.2, 3.4, 4.6), strict=False))
    return {
        m.name: {
            "color": COLOURS[i % len(COLOURS)],
            "label": m.name,
            **({"marker": "", "lw": widths.get(m.name, 4.6)} if m.name in smooth else dots),
        }
        for i, m in enumerate(solved)
    }


def _draw_band(axes: "Axes", estimate: Estimate, i: int, colour: str) -> None:
    """Fill what a method's own covariance allows its error."""
    J = rotations.euler_jacobian(estimate.R_nb)
    covariance = J @ np.asarray(estimate.attitude_covariance_rad2) @ rotations.transpose(J)
    band_deg = _BAND_SIGMAS * np.degrees(np.sqrt(covariance[:, i, i]))
    t_s, band_deg = drawable(estimate.t_s, band_deg, _BINS)
    label = f"±3σ of {estimate.method}"
    face: Any = {"color": colour, "alpha": 0.2, "lw": 0, "zorder": 1.5}
    axes.fill_between(t_s, -band_deg, band_deg, label=label, **face)
    for edge_deg in (-band_deg, band_deg):  # seen also where a long flight's line fills the band
        axes.plot(t_s, edge_deg, color="#444444", lw=0.7, ls=":", zorder=3)


def _draw_rms(
    axes: "Axes", rms: dict[str, float | None], styles: dict[str, Any], bound: float | None
) -> None:
    """Draw one dot per method on a logarithmic axis, its figure beside it, and the bound."""
    known = [value for value in rms.values() if value]
    for place, (name, value) in enumerate(rms.items()):
        if value:
            axes.plot(value, -place, "o", color=styles[name]["color"], ms=6)
            axes.annotate(
                f"{value:.3g}",
                (value, -place),
                (7, 0),
                textcoords="offset points",
                va="center",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
            )
    if bound:
        axes.axvline(bound, color="#555555", lw=1, ls="--", zorder=0)
        axes.annotate(
            "bound", (bound, 0.6), (3, 0), textcoords="offset points", color="#555555", fontsize=8
        )
        known.append(bound)
    if known:
        axes.set(xscale="log", xlim=(min(known) / 2, max(known) * 5))
        axes.minorticks_off()
    axes.set(ylim=(-len(rms) + 0.3, 1.1), yticks=[])
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="x", which="both", length=0, labelbottom=False)
    axes.grid(visible=False)


def _attitude_rms_deg(method: Method) -> float:
    """Return what methods are ordered by; those without a figure come last."""
    rms = method.score.attitude_rmse_deg
    return np.inf if rms is None else rms


def _claimed_variance_rad2(estimate: Estimate) -> float:
    covariance = np.asarray(estimate.attitude_covariance_rad2)
    return float(np.trace(covariance, axis1=1, axis2=2).mean())


def _legend(figure: "Figure", axes: "Axes", methods: list[Method], styles: dict[str, Any]) -> None:
    """Draw one legend for all rows: a dot per method in the order asked, and the band."""
    from matplotlib.lines import Line2D  # noqa: PLC0415  # lazy, as above

    handles: list[Any] = [
        Line2D([], [], color=styles[m.name]["color"], marker="o", ms=5, lw=1.5, label=m.name)
        for m in methods
    ]
    handles += [band for band in axes.collections if "σ" in str(band.get_label())]
    figure.legend(handles=handles, loc="outside upper right", ncols=len(handles), frameon=False)

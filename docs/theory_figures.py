"""Draw the figures of the theory pages: ``python docs/theory_figures.py [NAME…]``.

Each function returns one figure; its name is that of the file in ``docs/theory/figures``.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import gtsam
import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Rectangle
from scipy.special import chdtri

from fgnav.geometry import rotations
from fgnav.graph.correlation import inflation
from fgnav.process import matern

FOLDER = Path(__file__).resolve().parent / "theory" / "figures"
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "fgnav",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#888888"


def notation() -> Figure:
    """Return the frames ``n`` and ``b`` with a lever arm."""
    figure, axes = plt.subplots(figsize=(5.6, 2.6))
    pitch = np.radians(25.0)
    forward = np.array([np.cos(pitch), np.sin(pitch)])
    down = np.array([np.sin(pitch), -np.cos(pitch)])
    origin, body = np.zeros(2), np.array([3.2, 0.5])
    outline = Ellipse(body, 3.0, 0.7, angle=np.degrees(pitch), facecolor="#f2f2f2")
    axes.add_patch(outline)
    for begin, vector, text, place, colour in (
        (origin, (0.9, 0.0), "north", (0.95, -0.05), GREY),
        (origin, (0.0, -0.9), "down", (0.08, -0.9), GREY),
        (origin, body, "$p$", (1.5, 0.36), BLUE),
        (body, 1.0 * forward, "forward", (4.2, 0.75), ORANGE),
        (body, 0.9 * down, "down", (3.68, -0.4), ORANGE),
        (body, -0.9 * forward - 0.45 * down, "lever arm $a$", (2.2, 0.75), GREEN),
    ):
        arrow = {"arrowstyle": "->", "color": colour}
        axes.annotate("", begin + np.array(vector), begin, arrowprops=arrow)
        axes.text(*place, text, color=colour, ha="right" if "lever" in text else "left")
    axes.text(0.0, 0.1, "origin of the flight", color=GREY, ha="center")
    axes.text(3.5, 0.3, "accelerometer", color=BLUE)
    axes.set(xlim=(-0.9, 5.2), ylim=(-1.1, 1.5), aspect="equal")
    axes.axis("off")
    return figure


def factor_graph() -> Figure:
    """Return three keyframes with their factors."""
    figure, axes = plt.subplots(figsize=(6.0, 2.9))
    for k in range(3):
        x = 2.4 * k
        axes.add_patch(Circle((x, 0), 0.42, facecolor="white", edgecolor=BLUE))
        axes.text(x, 0, f"$x_{k}$", ha="center", va="center")
        for row, (y, name) in enumerate(((1.1, "phase"), (-1.1, "position"))):
            axes.plot([x, x], [0.42 if y > 0 else -0.42, y], color=GREY, zorder=0)
            axes.plot(x, y, "s", color=ORANGE)
            shown = name if k == 0 or row == 0 else "velocity"
            axes.text(x - 0.15, y - 0.06, shown, va="center", ha="right")
        if k < 2:
            axes.plot([x + 0.42, x + 1.98], [0, 0], color=GREY, zorder=0)
            axes.plot(x + 1.2, 0, "s", color=GREEN)
            axes.text(x + 1.2, 0.18, "motion", ha="center")
    for x, name in ((1.2, "arcs $A$"), (3.6, "constants $c$")):
        y = 2.1 if "arcs" in name else -2.1
        axes.add_patch(Ellipse((x, y), 1.7, 0.6, facecolor="white", edgecolor=BLUE))
        axes.text(x, y, name, ha="center", va="center")
    for k in range(3):
        axes.plot([1.2, 2.4 * k], [1.8, 1.1], color=GREY, lw=0.7, zorder=0)
        axes.plot([3.6, 2.4 * k], [-1.8, -1.1], color=GREY, lw=0.7, zorder=0)
    axes.plot(-1.1, 0, "s", color=GREY)
    axes.plot([-1.1, -0.42], [0, 0], color=GREY, zorder=0)
    axes.text(-1.1, 0.18, "prior", ha="center")
    axes.set(xlim=(-1.6, 6.2), ylim=(-2.5, 2.5))
    axes.axis("off")
    return figure


def inertial_motion() -> Figure:
    """Return the velocity error of two preintegrations against the steps of an interval."""
    rate, force, span_s = np.array([2 * np.pi, 0.5, 0.3]), np.array([3.0, -2.0, -9.0]), 0.1

    def summed(kind: type, steps: int) -> np.ndarray:
        parameters = gtsam.PreintegrationCombinedParams(np.zeros(3))
        made = kind(parameters, gtsam.imuBias.ConstantBias())
        for _ in range(steps):
            made.integrateMeasurement(force, rate, span_s / steps)
        start = gtsam.NavState(gtsam.Rot3(), np.zeros(3), np.zeros(3))
        return np.asarray(made.predict(start, gtsam.imuBias.ConstantBias()).velocity())

    Galilean = gtsam.PreintegratedCombinedMeasurementsG
    truth, steps = summed(Galilean, 4000), np.array([1, 2, 3, 5, 10, 20, 40])
    figure, axes = plt.subplots(figsize=(5.2, 2.8))
    for kind, name, colour in (
        (gtsam.PreintegratedCombinedMeasurements, "CombinedImuFactor", ORANGE),
        (Galilean, "GalileanCombinedImuFactor", BLUE),
    ):
        error = [np.linalg.norm(summed(kind, n) - truth) for n in steps]
        axes.loglog(steps, np.maximum(error, 1e-14), "o-", color=colour, label=name)
    axes.set(xlabel="steps in 0.1 s of a spin of 1 Hz", ylabel="velocity error, m/s")
    axes.legend()
    return figure


def gyro_free_motion() -> Figure:
    """Return autocorrelations of a rate by the prior's poles."""
    tau_s = np.linspace(0, 4, 200)
    figure, axes = plt.subplots(figsize=(5.2, 2.8))
    for name, ratio, damping, colour in (
        ("Matérn 5/2", 1.0, 1.0, BLUE),
        ("pole ratio 3, damping 0.2", 3.0, 0.2, ORANGE),
        ("pole ratio 0.3, damping 0.2", 0.3, 0.2, GREEN),
    ):
        poles = matern.poles(1.0, ratio, damping)
        P = matern.stationary(poles)
        correlation = [matern.transition(t, poles)[0] @ P[:, 0] for t in tau_s]
        axes.plot(tau_s, correlation, color=colour, label=name)
    axes.set(xlabel="lag, s (length scale 1 s)", ylabel="autocorrelation of the rate")
    axes.legend()
    return figure


def gnss_phase() -> Figure:
    """Return arcs of five satellites and the blocks that hold them."""
    figure, axes = plt.subplots(figsize=(5.6, 2.6))
    arcs = {
        "G05": [(0, 2.2), (2.2, 6)],
        "G12": [(0, 6)],
        "G17": [(0, 1.1), (3.4, 6)],
        "E03": [(0.8, 6)],
        "E11": [(0, 4.6)],
    }
    for row, spans in enumerate(arcs.values()):
        for begin, end in spans:
            axes.plot(
                [begin + 0.04, end - 0.04], [row, row], color=BLUE, lw=4, solid_capstyle="butt"
            )
    events = {0.0, 6.0, *(t for spans in arcs.values() for span in spans for t in span)}
    edges = sorted(events | {float(t) for t in np.arange(0, 6.01, 0.5)})
    for t in edges:
        is_event = t in events
        axes.axvline(t, color=ORANGE if is_event else GREY, lw=1.0 if is_event else 0.4)
    axes.set(yticks=range(len(arcs)), yticklabels=arcs, xlabel="time, s", xlim=(-0.1, 6.1))
    axes.set_title("a block A ends each half second (grey) and with each arc (orange)", fontsize=9)
    return figure


def integers() -> Figure:
    """Return the confidence ellipse of two ambiguities as they are and decorrelated."""
    Q = np.array([[6.29, 5.978], [5.978, 5.79]]) / 20
    a, Z = np.array([0.35, 0.2]), np.array([[1, -1], [0, 1]])
    figure, panels = plt.subplots(1, 2, figsize=(6.0, 2.8))
    for axes, cov, mean, title in (
        (panels[0], Q, a, "double differences"),
        (panels[1], Z @ Q @ Z.T, Z @ a, "after the integer transformation"),
    ):
        values, vectors = np.linalg.eigh(cov)
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        width, height = 2 * np.sqrt(chdtri(2, 0.01) * values[::-1])
        axes.add_patch(Ellipse(mean, width, height, angle=angle, facecolor="none", edgecolor=BLUE))
        grid = np.array(np.meshgrid(np.arange(-3, 4), np.arange(-3, 4))).reshape(2, -1)
        axes.plot(*grid, ".", color=GREY)
        axes.plot(*mean, "x", color=ORANGE)
        axes.set(aspect="equal", title=title, xlim=(-2.6, 2.9), ylim=(-2.6, 2.9))
        axes.title.set_fontsize(9)
    return figure


def alignment() -> Figure:
    """Return the heading's sigma and the probability of chance by coherence."""
    C = np.linspace(0.05, 0.98, 200)
    figure, (left, right) = plt.subplots(1, 2, figsize=(6.4, 2.7), layout="constrained")
    for N, colour in ((6, ORANGE), (12, GREEN), (28, BLUE)):
        left.semilogy(C, np.degrees(np.sqrt((1 - C) / (2 * C * N))), color=colour, label=f"N = {N}")
        right.semilogy(C, (1 - C) ** (N - 1), color=colour)
    left.set(xlabel="squared coherence C", ylabel="sigma of heading, deg")
    right.set(xlabel="squared coherence C", ylabel="probability by noise alone", ylim=(1e-16, 1))
    right.axhline(1e-7, color=GREY, lw=0.8)
    left.legend()
    return figure


def solvers() -> Figure:
    """Return a window that slides over keyframes."""
    figure, axes = plt.subplots(figsize=(6.0, 1.9))
    for begin, width, text, colour in (
        (0.0, 3.0, "marginalized", GREY),
        (3.0, 5.0, "lag: relinearized on demand", BLUE),
        (8.0, 1.0, "block", ORANGE),
    ):
        axes.add_patch(Rectangle((begin, -0.5), width, 1.0, facecolor=colour, alpha=0.15))
        axes.text(begin + width / 2, 0.62, text, ha="center", color=colour)
    t_s = np.arange(0.1, 9.0, 0.2)
    axes.plot(t_s, np.zeros_like(t_s), "o", ms=3, color="black")
    arrow = {"arrowstyle": "->"}
    axes.annotate("leaves with this update", (3.5, -0.05), (4.4, -0.95), arrowprops=arrow)
    axes.annotate("newest", (8.9, -0.05), (8.0, -0.95), arrowprops=arrow)
    axes.set(xlim=(-0.1, 9.4), ylim=(-1.15, 0.95), xlabel="time, s", yticks=[])
    axes.spines["left"].set_visible(False)
    return figure


def noise_and_verdicts() -> Figure:
    """Return the limit of innovations of a block by its degrees of freedom."""
    freedom, rate = np.arange(3, 400), 0.01 / 300
    figure, axes = plt.subplots(figsize=(5.2, 2.8))
    band = chdtri(freedom, rate) / freedom
    axes.loglog(freedom, band, color=GREY, ls="--", label="chi-square, 300 tests")
    for tolerance, name, colour in ((16, "1 s", BLUE), (6, "5 s", GREEN), (2.25, "record", ORANGE)):
        axes.loglog(freedom, np.maximum(band, tolerance), color=colour, label=f"limit, {name}")
    axes.set(xlabel="degrees of freedom", ylabel="NIS per degree of freedom", ylim=(1, 60))
    axes.legend(ncols=2, loc="upper right")
    return figure


def learned_factors() -> Figure:
    """Return how much of a constant's information is kept by the interval of answers."""
    between = np.linspace(0.2, 6, 200)
    kept = [2 / (np.log(2) * d * inflation(1.0, d)) for d in between]
    figure, axes = plt.subplots(figsize=(5.2, 2.6))
    axes.plot(between, kept, color=BLUE)
    axes.axvline(2.0, color=ORANGE, lw=0.8)
    axes.text(2.1, 0.2, "default, two half-lives", color=ORANGE)
    axes.set(xlabel="interval of answers over half-life", ylabel="information kept", ylim=(0, 1.05))
    return figure


def covariance() -> Figure:
    """Return the sigma of pitch by first and second order beside drawn attitudes."""
    pitch = np.radians(45.0)
    R = rotations.from_euler(*np.array([[0.0], [pitch], [0.0]]))
    sigma_deg, rng = np.linspace(0.5, 30, 25), np.random.default_rng(1)
    first, second, drawn = [], [], []
    for sigma in np.radians(sigma_deg):
        axes_sigma = np.array([0.01, 0.01, sigma])  # next to nothing but about z_b
        P = np.diag(axes_sigma**2)[None]
        J = rotations.euler_jacobian(R)
        first.append(np.sqrt((J @ P @ J.swapaxes(1, 2))[0, 1, 1]))
        second.append(rotations.euler_sigma(R, P)[0, 1])
        turns = rotations.exp(axes_sigma * rng.standard_normal((4000, 3)))
        drawn.append(np.sqrt(((rotations.to_euler(R @ turns)[:, 1] - pitch) ** 2).mean()))
    figure, axes = plt.subplots(figsize=(5.2, 2.8))
    for values, style, name, colour in (
        (first, "--", "first order", GREY),
        (second, "-", "second order", BLUE),
        (drawn, "o", "drawn attitudes", ORANGE),
    ):
        axes.plot(sigma_deg, np.degrees(values), style, ms=3, color=colour, label=name)
    axes.set(xlabel="sigma about z_b, deg", ylabel="RMS of pitch at 45°, deg")
    axes.legend()
    return figure


FIGURES: tuple[Callable[[], Figure], ...] = (
    notation, factor_graph, inertial_motion, gyro_free_motion, gnss_phase, integers,
    alignment, solvers, noise_and_verdicts, learned_factors, covariance,
)  # fmt: skip


def main(names: list[str]) -> None:
    """Draw all figures, or some by name."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        for draw in FIGURES:
            if not names or draw.__name__ in names:
                figure = draw()
                path = FOLDER / f"{draw.__name__}.svg"
                figure.savefig(path, bbox_inches="tight", metadata={"Date": None})
                plt.close(figure)


if __name__ == "__main__":
    main(sys.argv[1:])

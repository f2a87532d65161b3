"""Draw the scenarios for sim/README.md: ``python sim/gallery/draw.py [name …]``."""

import sys
from pathlib import Path

import msgspec
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from fgnav.evaluation.report.charts import unjumped_deg
from fgnav.geometry.rotations import to_euler
from fgnav.shipped import shipped
from fgnav.types.flight import Flight, Truth
from fgnav.types.observations import LOST_LOCK, Observations
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

HERE = Path(__file__).resolve().parent
LONGEST_S = 60.0  # what is longer repeats itself …
SAME = ("hour", "beacon")  # … and these fly like demo and approach
SEED = 1
ROW = 0.17  # inches of a channel: its name can be read
OFTEN = 0.05  # share of samples at which an angle wraps: more are dots


def main(names: list[str]) -> None:
    """Draw the named scenarios, or all."""
    for name in shipped("fgnav_sim", "scenarios"):
        if name in names or not (names or name in SAME):
            scenario = load_scenario(name)
            shorter = min(scenario.duration_s, LONGEST_S)
            flight = simulate(
                msgspec.structs.replace(scenario, duration_s=shorter), np.random.default_rng(SEED)
            )
            _draw(flight).savefig(HERE / f"{name}_flight.png", dpi=80)


def _draw(flight: Flight) -> Figure:
    """Return track, attitude, and what the receivers track."""
    seen = flight.observations
    channels = 0 if seen is None else len(seen.satellites)
    height = max(3.4, 0.9 + ROW * channels)
    figure = Figure(figsize=(13, height))
    figure.set_layout_engine("constrained", wspace=0.04)
    track, attitude, sky = figure.subplots(1, 3, width_ratios=(1.2, 1.5, 1.6))
    if flight.truth is not None:
        _draw_track(figure, track, flight.truth)
        _draw_attitude(attitude, flight.truth)
    if seen is not None:
        _draw_sky(figure, sky, seen)
    else:
        sky.set_axis_off()
    return figure


def _draw_track(figure: Figure, axes: Axes, truth: Truth) -> None:
    """Draw the way, coloured by time, from above or, where it is steep, from the side."""
    north_m, east_m, down_m = truth.p_n_m.T
    level_m = np.hypot(north_m - north_m[0], east_m - east_m[0])
    is_steep = np.ptp(down_m) > np.ptp(level_m)
    x, y = (level_m, -down_m) if is_steep else (east_m, north_m)
    names = ("distance, m", "height, m") if is_steep else ("east, m", "north, m")
    points = np.column_stack([x, y])
    way = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)),
        cmap="viridis",
        array=truth.t_s[:-1],
        lw=2,
    )
    axes.add_collection(way)
    axes.plot(x[0], y[0], "o", color="tab:red", markersize=5, label="start")
    axes.set(xlabel=names[0], ylabel=names[1], aspect="equal", adjustable="datalim")
    axes.autoscale_view()
    axes.locator_params(axis="x", nbins=4)
    axes.legend(fontsize=8, loc="best")
    axes.set_title(f"height changes by {round(float(down_m[0] - down_m[-1]))} m", fontsize=9)
    figure.colorbar(way, ax=axes, label="time, s")


def _draw_attitude(axes: Axes, truth: Truth) -> None:
    """Draw the angles; where two coincide, both show."""
    angles = zip(to_euler(truth.R_nb).T, ("roll", "pitch", "yaw"), (4.0, 2.4, 1.0), strict=True)
    for angle_rad, name, width in angles:
        angle_deg = np.degrees(angle_rad)
        whole_deg = unjumped_deg(angle_deg)
        if np.isnan(whole_deg).mean() > OFTEN:
            axes.plot(truth.t_s, angle_deg, ".", markersize=3, label=name)
        else:
            axes.plot(truth.t_s, whole_deg, linewidth=width, label=name)
    axes.set(xlabel="time, s", ylabel="angle, °")
    axes.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)


def _draw_sky(figure: Figure, axes: Axes, seen: Observations) -> None:
    """Draw by channel how many antennas track it, and where a receiver says it lost lock."""
    antennas = seen.tracked.shape[1]
    count = seen.tracked.sum(axis=1).T
    shades = colormaps["Blues"].resampled(antennas + 1)
    extent = (seen.t_s[0], seen.t_s[-1], len(seen.satellites) - 0.5, -0.5)
    shown = {"cmap": shades, "vmin": -0.5, "vmax": antennas + 0.5, "interpolation": "none"}
    image = axes.imshow(count, aspect="auto", extent=extent, **shown)
    epoch, _, channel = np.nonzero(seen.lock_flags & LOST_LOCK)
    if len(epoch):
        axes.plot(seen.t_s[epoch], channel, ".", color="tab:red", markersize=4, label="lost lock")
        axes.legend(
            fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, markerscale=2
        )
    several = len(set(seen.satellites)) < len(seen.satellites)
    names = [
        f"{a} {b}" if several else a for a, b in zip(seen.satellites, seen.signals, strict=True)
    ]
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.hlines(np.arange(1, len(names)) - 0.5, *extent[:2], color="white", linewidth=1)
    axes.set(xlabel="time, s")
    ticks = np.unique(np.linspace(0, antennas, min(antennas, 4) + 1).round())
    figure.colorbar(image, ax=axes, label="antennas that track", ticks=ticks)


if __name__ == "__main__":
    main(sys.argv[1:])

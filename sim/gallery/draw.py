"""Draw the scenarios for sim/README.md: ``python sim/gallery/draw.py [name …]``."""

import sys
from pathlib import Path

import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fgnav.geometry.rotations import to_euler
from fgnav.shipped import shipped
from fgnav.types.flight import Flight, Truth
from fgnav.types.observations import LOST_LOCK, Observations
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

HERE = Path(__file__).resolve().parent
LONGEST_S = 60.0  # what is longer repeats itself …
SAME = ("hour", "beacon")  # … and these fly like demo and terminal
SEED = 1


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
    figure = Figure(figsize=(12, 3), layout="constrained")
    track, attitude, sky = figure.subplots(1, 3, width_ratios=(1, 1.5, 1.5))
    if flight.truth is not None:
        _draw_track(track, flight.truth)
        _draw_attitude(attitude, flight.truth)
    if flight.observations is not None:
        _draw_sky(sky, flight.observations)
    return figure


def _draw_track(axes: Axes, truth: Truth) -> None:
    north_m, east_m, down_m = truth.p_n_m.T
    level_m = np.hypot(north_m - north_m[0], east_m - east_m[0])
    if np.ptp(down_m) > np.ptp(level_m):  # steep: seen from the side
        axes.plot(level_m, -down_m, linewidth=1)
        axes.plot(level_m[0], -down_m[0], "o", markersize=4)
        axes.set(xlabel="distance, m", ylabel="height, m", aspect="equal", adjustable="datalim")
        return
    axes.plot(east_m, north_m, linewidth=1)
    axes.plot(east_m[0], north_m[0], "o", markersize=4)
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal", adjustable="datalim")
    axes.set_title(f"height changes by {round(float(down_m[0] - down_m[-1]))} m", fontsize=9)


def _draw_attitude(axes: Axes, truth: Truth) -> None:
    for angle_rad, name in zip(to_euler(truth.R_nb).T, ("roll", "pitch", "yaw"), strict=True):
        axes.plot(truth.t_s, np.degrees(angle_rad), linewidth=1, label=name)
    axes.set(xlabel="s", ylabel="angle, °")
    axes.legend(fontsize=8, loc="upper right")


def _draw_sky(axes: Axes, seen: Observations) -> None:
    """Draw by channel how many antennas track it, and where a receiver says it lost lock."""
    extent = (seen.t_s[0], seen.t_s[-1], len(seen.satellites) - 0.5, -0.5)
    shade = seen.tracked.mean(axis=1).T
    axes.imshow(
        shade, aspect="auto", extent=extent, cmap="Blues", vmin=0, vmax=1.5, interpolation="none"
    )
    epoch, _, channel = np.nonzero(seen.lock_flags & LOST_LOCK)
    axes.plot(seen.t_s[epoch], channel, ".", color="tab:red", markersize=2)
    axes.set_yticks(range(len(seen.satellites)), seen.satellites, fontsize=5)
    axes.set(xlabel="s")
    axes.set_title("share of antennas that track; flags in red", fontsize=9)


if __name__ == "__main__":
    main(sys.argv[1:])

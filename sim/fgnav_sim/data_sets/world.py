"""Format of a world file: skies, array, attitudes and noise of a data set."""

from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec
from msgspec import field

from fgnav.checks import BadInputError
from fgnav.io.strict_toml import NotNegative, Positive, Table, Vector, as_table, read_toml
from fgnav.shipped import file_or_shipped
from fgnav_sim.data_sets.attitudes import Attitudes, UniformAttitudes
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.gnss.tables import Angle, MultipathTable, ReflectorTable, check_signals
from fgnav_sim.ranges import Count, check_ranges
from fgnav_sim.scenario import PAPER_ANTENNAS_B_M, Place

# A figure, or the range it is drawn from. Neither constraints nor fixed lengths: msgspec 0.22 takes
# one for the other where both stand in a union.
Drawn: TypeAlias = float | tuple[float, ...]


class FixedSite(Table, frozen=True, tag="fixed", tag_field="kind"):
    """One place for all runs; Madrid where nothing is said."""

    place: Place = Place()


class AnySites(Table, frozen=True, tag="anywhere", tag_field="kind"):
    """A place for each run, uniform over the globe, at a height within a range."""

    height_m: tuple[float, float] = (0.0, 3000.0)


class DayTimes(Table, frozen=True, tag="day", tag_field="kind"):
    """Times on a grid from the world's start on; a run begins where it still fits in.

    A run as long as the span begins at its start: all runs then see the same sky.
    """

    duration_s: Positive = 86_400.0


class AnyTimes(Table, frozen=True, tag="any", tag_field="kind"):
    """Runs that begin at moments uniform over a span of days."""

    days: Positive = 365.0
    # runs that share one moment, hence the satellites' orbits: 8 runs at places anywhere see skies
    # that have nothing in common, and cost a third of the time. Runs at given places never share.
    runs_per_moment: Count = 8


class SatellitesTable(Table, frozen=True):
    """Which satellites an epoch has; rules hold for each constellation by itself."""

    # RINEX 3 signals by constellation letter; each is a group of channels of its own
    signals: dict[str, tuple[str, ...]] = field(default_factory=lambda: {"G": ("1C",)})
    # all in view (the 16 highest, if there are more), so many, or a number drawn for each run
    choose: Literal["all"] | int | tuple[int, ...] = 6
    # the best geometry, as ``fgnav_sim.gnss.selection`` chooses for 15 min, or any
    pick: Literal["geometry", "random"] = "geometry"
    mask_deg: Angle = 10.0

    def __post_init__(self) -> None:
        """Check signals and range."""
        check_signals(self.signals)
        if self.choose != "all":
            check_ranges(self, "choose")


class NoiseTable(Table, frozen=True):
    """White noise of one link at the zenith; where a range is given, drawn for each run (log)."""

    code_m: Drawn = 0.5
    phase_m: Drawn = 0.003
    # ``sine`` divides the noise by the sine of the elevation
    elevation_weights: Literal["uniform", "sine"] = "uniform"

    def __post_init__(self) -> None:
        """Check ranges."""
        check_ranges(self, "code_m", "phase_m")


class OutliersTable(Table, frozen=True):
    """Links with noise of which nobody is told, each epoch anew."""

    share: Annotated[float, msgspec.Meta(gt=0, lt=1)]  # of links
    # code_m, phase_m: standard deviation of what is added
    code_m: NotNegative = 1.5
    phase_m: NotNegative = 0.015


class RunsTable(Table, frozen=True):
    """Consecutive epochs of one simulation: its site, array, integers and noise level stay."""

    epochs: Count = 1
    step_s: Positive = 15.0


class World(Table, frozen=True, tag="array", tag_field="kind"):
    """Epochs of antenna arrays to be drawn."""

    name: str = ""
    # GPS time of ``t_s = 0``
    start: Annotated[datetime, msgspec.Meta(tz=False)] = datetime(2020, 6, 25)
    # epochs, shard_epochs: how many a data set holds, and one file of it
    epochs: Count = 576_000
    shard_epochs: Count = 57_600
    sites: FixedSite | AnySites = FixedSite()
    times: DayTimes | AnyTimes = DayTimes()
    runs: RunsTable = RunsTable()
    satellites: SatellitesTable = SatellitesTable()
    # phase centres in body axes; the first is the reference. The paper's eight by default.
    antennas_b_m: tuple[Vector, ...] = PAPER_ANTENNAS_B_M
    attitudes: Attitudes = UniformAttitudes()
    noise: NoiseTable = NoiseTable()
    outliers: OutliersTable | None = None
    multipath: MultipathTable | None = None
    # parts of the body that mirror signals
    reflectors: tuple[ReflectorTable, ...] = ()

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        if self.shard_epochs % self.runs.epochs:
            raise ValueError(
                f"shard_epochs: must hold whole runs of {self.runs.epochs}, got {self.shard_epochs}"
            )
        if len(self.antennas_b_m) < 2:
            raise ValueError("antennas_b_m: must hold two antennas or more")
        span_s = (self.runs.epochs - 1) * self.runs.step_s
        if isinstance(self.times, DayTimes) and span_s >= self.times.duration_s:
            raise ValueError(
                f"times.duration_s: must be longer than a run, {span_s:g} s, "
                f"got {self.times.duration_s:g}"
            )


def load_world(world: Path | str) -> World | GravityWorld:
    """Return a world: a TOML file's, or that of a name that comes with the simulator.

    Raises
    ------
    BadInputError
        One line that names file, key, rule and value.
    """
    path = file_or_shipped(world, "fgnav_sim", "worlds")
    content = read_toml(path)
    kinds: dict[object, type[World] | type[GravityWorld]] = {
        "array": World,
        "gravity": GravityWorld,
    }
    kind = content.get("kind", "array")
    if kind not in kinds:
        raise BadInputError(f"{path}: key kind: must be array or gravity, got {kind!r}")
    content["kind"] = kind
    table = as_table(path, content, kinds[kind])
    return table if table.name else msgspec.structs.replace(table, name=path.stem)

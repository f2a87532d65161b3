"""Two real antennas, one epoch of GPS L1 at a time, at rising elevation masks.

Reads the Wettzell recordings from FGNAV_SHARED; without them there are no rows.
"""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

from fgnav.gnss.difference import double_differences
from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.array.search import search_constrained
from fgnav.integers.ils.affine import search_array
from fgnav.io.flight.folder import load_flight
from fgnav.types.flight import Flight
from tests.benchmarks._rows import DATA, Row, row
from tests.integers.wettzell import of_signals, right_cycles, write_flight

MASKS = (10, 15, 20, 25, 30, 35)
NODES = 10**6
NAMES = tuple(f"elevation_mask_{mask}" for mask in MASKS)


def run() -> list[Row]:
    """Return a row for each mask."""
    if not (DATA / "wettzell").is_dir():
        return []
    published = json.loads((DATA / "integers" / "wtz_single_epoch_success.json").read_text())
    with TemporaryDirectory() as folder:
        flight = load_flight(write_flight(Path(folder), DATA))
    rows = {row["mask_deg"]: row for row in published["rows"]}
    return [_row(flight, mask, rows[mask]) for mask in MASKS]


def _row(flight: Flight, mask: int, published: dict[str, float]) -> Row:
    """Resolve the epochs that have five satellites, as the published row counts them."""
    d = of_signals(double_differences(flight), {"G1"}, mask)
    enough = d.resolvable.sum(axis=(1, 2)) >= 4
    raw = search_constrained(d, NODES)
    share = 100.0 * float(right_cycles(d, raw.cycles)[enough].mean())
    free = 100.0 * float(right_cycles(d, search_array(d, joint=True).cycles)[enough].mean())
    known, of_lambda = published["length_constrained_pct"], published["LAMBDA_pct"]
    note = (
        f"{enough.sum()} epochs; peer: published known length; LAMBDA {free:.1f} %, published "
        f"{of_lambda:.1f} %; proven {(raw.status[enough] == PROVEN).sum()}"
    )
    return row(f"elevation_mask_{mask}", share, known, "%", note)

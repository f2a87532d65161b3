"""Renew the tables of the documents: ``python docs/tables.py [results]``.

With ``results`` the yardstick.json and bench.json of the last ``make bench`` become the CSV files
in ``docs/evidence``, seeds and all. Tables between ``<!-- table: NAME -->`` and ``<!-- end -->``
are made of these files alone.
"""

import csv
import json
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from math import degrees
from pathlib import Path
from statistics import mean, median

ROOT = Path(__file__).resolve().parents[1]
EVIDENCE = ROOT / "docs" / "evidence"
PAGES = (
    *(EVIDENCE / f"{name}.md" for name in ("validation", "performance", "networks", "outages")),
    ROOT / "README.md",
)
STATES = {"attitude": "deg", "position": "m", "velocity": "m/s"}
OUTCOMES = {
    "right": "right",
    "degraded": "degraded",
    "refused": "no answer",
    "said and wrong": "wrong, reported",
    "silent and wrong": "wrong, silent",
    "crashed": "crashed",
}
FLIGHTS = {
    "array": "eight antennas, accelerometer",
    "spin": "the same, spinning",
    "rocket": "the same on a flown rocket",
    "glider": "the same on a glider in gusts",
    "array_1hz": "eight antennas once a second, accelerometer",
    "array_gyro": "eight antennas, accelerometer and gyroscope",
    "raw": "one antenna, raw phase, gyroscope",
    "fixes_1hz": "fixes once a second, gyroscope",
    "fixes_5hz": "fixes five times a second, gyroscope",
    "instruments": "fixes, gyroscope, barometer, magnetometer, line of sight",
}
RECORDS = {
    "antennas": "antenna positions",
    "detector": "photodetector",
    "f_b_mps2": "accelerometer",
    "field_b_ut": "magnetometer",
    "imu": "inertial timestamps, lost samples",
    "observations": "raw GNSS",
    "w_b_radps": "gyroscope",
}
_MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
Row = dict[str, str]


def main(words: list[str]) -> None:
    """Renew CSV files if asked for, then every table."""
    if "results" in words:
        keep_results()
    for page in PAGES:
        page.write_text(rendered(page.read_text(encoding="utf-8")), encoding="utf-8")


def keep_results() -> None:
    """Write the last results as CSV: a row for each estimate, and for each benchmark."""
    results = json.loads((ROOT / "yardstick.json").read_text())["results"]
    rows = []
    for one in results:
        row = {key: one[key] for key in ("part", "name", "method", "seed", "fault", "outcome")}
        row |= {"reported": int(one["said"]), "seconds": f"{one['seconds']:.2f}"}
        for state in STATES:
            row[f"rmse_{state}"] = _digits(one["rmse"].get(state))
            row[f"nees_{state}"] = _digits(one["nees"].get(state))
        rows.append(row)
    _write(EVIDENCE / "yardstick.csv", rows)
    bench = json.loads((ROOT / "bench.json").read_text())
    kept = [row for row in bench if not row["name"].startswith("yardstick")]
    if kept:
        for row in kept:
            row |= {key: _digits(row[key]) for key in ("ours", "peer", "ratio")}
        _write(EVIDENCE / "bench.csv", kept)


def rendered(text: str) -> str:
    """Return a page with its tables as the CSV files have them."""
    return _MARKED.sub(lambda m: f"{m[1]}{TABLES[m[2]]()}{m[3]}", text)


def clean() -> str:
    """Return errors and NEES of clean flights, by kind."""
    return _of_groups(_rows("clean", method="batch"), FLIGHTS)


def methods() -> str:
    """Return the same by method, of the kinds and seeds that all methods estimate."""
    rows = [row for row in _rows("clean") if row["name"] in ("array", "fixes_5hz")]
    seeds = {row["seed"] for row in rows if row["method"] == "forward"}
    groups = {}
    for name in ("array", "fixes_5hz"):
        for method in ("batch", "smoother", "forward"):
            of = [r for r in rows if (r["name"], r["method"]) == (name, method)]
            groups[f"{FLIGHTS[name]}: `{method}`"] = [r for r in of if r["seed"] in seeds]
    return _errors(groups)


def recordings() -> str:
    """Return errors and NEES of recordings."""
    rows = _rows("recordings")
    measured = [row for row in rows if any(row[f"rmse_{s}"] or row[f"nees_{s}"] for s in STATES)]
    return _of_groups(measured, {})


def outcomes() -> str:
    """Return how many drawn flights ended how, clean and with a fault of each record."""
    clean_rows, faulty = _rows("drawn"), _rows("faulty")
    groups = {"no fault": clean_rows}
    for row in sorted(faulty, key=_record):
        groups.setdefault(f"fault of {_record(row)}", []).append(row)
    groups["all faults"] = faulty
    head = ("flights", "n", *OUTCOMES.values(), "with a verdict")
    lines = []
    for name, rows in groups.items():
        counts = Counter(row["outcome"] for row in rows)
        cells = [str(counts[key]) for key in OUTCOMES]
        lines.append((name, str(len(rows)), *cells, str(sum(int(r["reported"]) for r in rows))))
    return _table(head, lines)


def summary() -> str:
    """Return attitude errors of clean flights, NEES and time, for the first page."""
    lines = []
    for name, text in FLIGHTS.items():
        rows = _rows("clean", method="batch", name=name)
        if rows:
            rmse = mean(float(row["rmse_attitude"]) ** 2 for row in rows) ** 0.5
            nees = mean(float(row["nees_attitude"]) for row in rows)
            seconds = median(float(row["seconds"]) for row in rows)
            lines.append((text, f"{rmse:.2g}", f"{nees:.1f}", f"{seconds:.1f}"))
    return _table(("flights", "attitude RMSE, deg", "NEES", "seconds"), lines)


def times() -> str:
    """Return processor seconds of one estimate, by kind of flight."""
    lines = []
    for name, text in FLIGHTS.items():
        seconds = [float(row["seconds"]) for row in _rows("clean", method="batch", name=name)]
        if seconds:
            figures = (median(seconds), min(seconds), max(seconds))
            lines.append((text, *(f"{s:.1f}" for s in figures)))
    return _table(("flight", "median, s", "least", "most"), lines)


def peers() -> str:
    """Return benchmarks, next to their peers; single cells of a published table are left out."""
    path = EVIDENCE / "bench.csv"
    rows = _read(path) if path.exists() else []
    rows = [row for row in rows if not re.match(r"teunissen_\d", row["name"])]
    return _table(
        ("benchmark", "fgnav", "peer", "ratio", "unit", "of what"),
        [(f"`{r['name']}`", r["ours"], r["peer"], r["ratio"], r["unit"], r["note"]) for r in rows],
    )


def answers() -> str:
    """Return what networks answer, next to the best constant of the other flights."""
    head = ("flights", "network", "answered, %", "RMSE", "unit", "NEES of 1", "NLL", "constant's")
    lines = []
    for row in _read(EVIDENCE / "networks.csv"):
        if row.get("failure"):
            lines.append((row["flights"], f"`{row['network']}`", *[""] * 8))
            continue
        scale, unit = (degrees(1), "deg") if row["unit"] == "rad" else (1.0, row["unit"])
        figures = [f"{100 * float(row['answered']):.0f}", f"{scale * float(row['rmse']):.2g}", unit]
        figures += [
            f"{float(row[key]):.2f}" for key in ("nees_network", "nll_network", "nll_constant")
        ]
        figures.append(_interval(row, "gain", "gain_low", "gain_high"))
        energies = [f"{scale * float(row[f'energy_{by}']):.2g}" for by in ("network", "constant")]
        lines.append((row["flights"], f"`{row['network']}`", *figures, " / ".join(energies)))
    return _table((*head, "difference of NLL", "energy / constant's"), lines)


def worth() -> str:
    """Return errors of a method without networks, at constant sigmas and with them."""
    states = {"attitude, deg": "matched_attitude_rmse_deg", "position, m": "position_rmse_m"}
    head = ("flights", "network", "state", "n", "none", "constant", "network", "NEES")
    lines = []
    for row in _read(EVIDENCE / "networks.csv"):
        for state, key in states.items() if not row.get("failure") else ():
            rmse = [f"{float(row[f'{key}_{by}']):.3g}" for by in ("none", "constant", "network")]
            name = state.partition(",")[0]
            nees = f"{float(row[f'{name}_nees_network']):.1f}"
            less = [
                _interval(row, *(f"{key}_less_{by}{end}" for end in ("", "_low", "_high")))
                for by in ("none", "constant")
            ]
            lines.append(
                (row["flights"], f"`{row['network']}`", state, row["n"], *rmse, nees, *less)
            )
    return _table((*head, "less none", "less constant"), lines)


def links() -> str:
    """Return how a smoother fares whose links are weighed in several ways."""
    head = (
        "flights",
        "weights",
        "n",
        "fixed, %",
        "wrong",
        "attitude, deg",
        "NEES",
        "NLL",
        "energy",
    )
    figures = {"attitude_rmse_deg": 3, "attitude_nees": 2, "attitude_nll": 4}
    figures |= {"attitude_energy_score_deg": 3, "position_nees": 2}
    lines = []
    for row in _read(EVIDENCE / "link_weights.csv"):
        cells = [row[key] for key in ("world", "weights", "flights", "fixed_percent", "wrong")]
        cells += [f"{float(row[key]):.{n}g}" if row[key] else "" for key, n in figures.items()]
        for other in ("constant", "cn0"):
            keys = [f"attitude_nll_less_{other}{end}" for end in ("", "_low", "_high")]
            cells.append(_interval(row, *keys) if row[keys[-1]] not in ("", "nan") else "")
        lines.append(tuple(cells))
    return _table((*head, "position NEES", "NLL less constant", "NLL less C/N0"), lines)


def outages() -> str:
    """Return errors and scores of states in outages, by the factors of the smoother."""
    figures = ("rmse", "nees", "nll", "energy")
    lines = []
    for row in _read(EVIDENCE / "outages.csv"):
        state = f"{row['state']}, {row['unit']}"
        cells = (f"{float(row[figure]):.3g}" for figure in figures)
        lines.append((row["method"], state, row["flights"], *cells))
    head = ("factors", "state", "n", "RMSE", "NEES of 1", "NLL", "energy")
    return _table(head, lines)


def outage_gains() -> str:
    """Return differences of scores in outages, the last method's less the others'."""
    lines = []
    for row in _read(EVIDENCE / "outages.csv"):
        if not row["nll_less"]:
            continue
        gains = (
            _interval(row, *(f"{figure}_{end}" for end in ("less", "low", "high")))
            for figure in ("rmse", "nll", "energy")
        )
        lines.append((row["method"], f"{row['state']}, {row['unit']}", *gains))
    return _table(("factors", "state", "RMSE", "NLL", "energy"), lines)


TABLES: dict[str, Callable[[], str]] = {
    table.__name__: table
    for table in (
        *(summary, clean, methods, recordings, outcomes, times, peers),
        *(answers, worth, outages, outage_gains, links),
    )
}


def _record(row: Row) -> str:
    """Return what a fault is of, in words."""
    name = row["fault"].partition(":")[0]
    return RECORDS.get(name, name)


def _of_groups(rows: Iterable[Row], texts: dict[str, str]) -> str:
    groups: dict[str, list[Row]] = {name: [] for name in texts}
    for row in rows:
        groups.setdefault(row["name"], []).append(row)
    return _errors({texts.get(name, f"`{name}`"): of for name, of in groups.items() if of})


def _errors(groups: dict[str, list[Row]]) -> str:
    """Return root mean squares of RMSE and means of NEES, a row for each group."""
    head = ["flights", "n"]
    for state, unit in STATES.items():
        head += [f"{state}, {unit}", "NEES"]
    lines = []
    for name, rows in groups.items():
        cells = [name, str(len(rows))]
        for state in STATES:
            squares = [float(r[f"rmse_{state}"]) ** 2 for r in rows if r[f"rmse_{state}"]]
            nees = [float(r[f"nees_{state}"]) for r in rows if r[f"nees_{state}"]]
            cells.append(f"{mean(squares) ** 0.5:.2g}" if squares else "")
            cells.append(f"{mean(nees):.1f}" if nees else "")
        lines.append(tuple(cells))
    return _table(tuple(head), lines)


def _table(head: tuple[str, ...], lines: Iterable[tuple[str, ...]]) -> str:
    words = (head[0], "network", "weights", "state", "unit", "of what")
    rule = ["---" if name in words else "---:" for name in head]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in (head, rule, *lines))


def _rows(part: str, **wanted: str) -> list[Row]:
    rows = _read(EVIDENCE / "yardstick.csv")
    wanted["part"] = part
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def _read(path: Path) -> list[Row]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _write(path: Path, rows: list[Row]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _interval(row: Row, *keys: str) -> str:
    """Return a figure with its interval, where there is one."""
    value, low, high = (f"{float(row[key]):+.2g}" for key in keys)
    return value if low == "+nan" else f"{value} ({low} to {high})"


def _digits(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


if __name__ == "__main__":
    main(sys.argv[1:])

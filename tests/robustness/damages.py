"""Damages drawn from a seed: what logs, disks, editors and strangers do to a flight folder.

A damage changes a folder in place and returns one line that says what was done.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

Damage = Callable[[Path, np.random.Generator], str]

_HUGE = ("1e300", "-1e300", "1e155", "9" * 400, "nan", "inf", "", "x", "1,5", "0x1p3", "1_0")
_CONTROL = ("\r", "\0", "\x0b", "\x0c", "\x1c", "\x85", "\x1b[31m", "\u2028", "\ufeff", "\xe9")
_TIMES_S = (604_800.0, -604_800.0, 18.0, -18.0, 86_400.0, 1e9, -1e9, 1e15, 1e-9, 3.6e3)


def series(folder: Path, rng: np.random.Generator) -> str:
    """Make one table of samples dirty."""
    path = _choice(rng, sorted(folder.glob("*.csv")))
    lines = path.read_text(encoding="utf-8").splitlines()
    dirt = _choice(rng, _DIRT)
    path.write_bytes(dirt(lines, rng).encode("utf-8", "surrogatepass"))
    return f"{path.name}: {dirt.__name__.strip('_').replace('_', ' ')}"


def bytes_of_any_file(folder: Path, rng: np.random.Generator) -> str:
    """Damage the bytes of a file."""
    path = _choice(rng, sorted(p for p in folder.iterdir() if p.is_file()))
    content = bytearray(path.read_bytes())
    kind = int(rng.integers(8))
    start, stop = sorted(rng.integers(0, len(content) + 1, 2).tolist())
    if kind <= 2:  # few bits flip
        for at in rng.integers(0, len(content), int(rng.integers(1, 4))).tolist():
            content[at] ^= 1 << int(rng.integers(8))
        what = "bits flipped"
    elif kind == 3:
        del content[start:]
        what = f"cut at byte {start}"
    elif kind == 4:
        stop = min(stop, start + int(rng.integers(1, 300)))
        del content[start:stop]
        what = f"{stop - start} bytes lost at {start}"
    elif kind == 5:
        stop = min(stop, start + 4096)
        content[start:stop] = bytes(stop - start)
        what = f"{stop - start} bytes zero at {start}"
    elif kind == 6:
        content[start:start] = content[start:stop]
        what = f"{stop - start} bytes twice at {start}"
    else:
        lines = bytes(content).splitlines(keepends=True)
        at = int(rng.integers(len(lines)))
        del lines[at : at + int(rng.integers(1, 4))]
        content = bytearray(b"".join(lines))
        what = f"lines lost at {at + 1}"
    path.write_bytes(bytes(content))
    return f"{path.name}: {what}"


def set_up(folder: Path, rng: np.random.Generator) -> str:
    """Change a value of ``flight.toml``, or a whole line."""
    path = folder / "flight.toml"
    lines = path.read_text(encoding="utf-8").splitlines()
    at = _choice(rng, [k for k, line in enumerate(lines) if "=" in line])
    key, _, value = lines[at].partition("=")
    kind = int(rng.integers(4))
    if kind == 0:
        new = []
    elif kind == 1 and re.search(r"\d", value):
        number = _choice(rng, ["0", "-1", "1e300", "-1e-300", "nan", "inf", "1e9", "0.0", "5e-324"])
        numbers = list(re.finditer(r"-?\d+(\.\d+)?(e-?\d+)?", value))
        one = _choice(rng, numbers)
        new = [f"{key}={value[: one.start()]}{number}{value[one.end() :]}"]
    elif kind == 2:
        new = [f"{key}= {_choice(rng, _VALUES)}"]
    else:
        new = [lines[at], _choice(rng, ["gibberish", f"{key}= 1", "[imu]", "[[antenna]]", "a = 1"])]
    lines[at : at + 1] = new
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"flight.toml: {lines[at][:60] if new else f'no {key.strip()}'}"


def hostile_toml(folder: Path, rng: np.random.Generator) -> str:
    """Put something into ``flight.toml`` that is meant to hurt its reader."""
    path = folder / "flight.toml"
    text = path.read_text(encoding="utf-8")
    n = int(10 ** rng.uniform(2, 5))
    bombs = {
        "arrays nested": f"a = {'[' * n}{']' * n}\n",
        "tables nested": f"a = {'{b=' * n}1{'}' * n}\n",
        "keys dotted": ".".join("a" * n) + " = 1\n",
        "header dotted": "[" + ".".join("a" * n) + "]\n",
        "quoted keys dotted": ".".join(['"a"'] * n) + " = 1\n",
        "huge integer": f"a = {'9' * n}\n",
        "huge float": f"a = 1{'0' * n}.0\n",
        "huge hexadecimal": f"a = 0x{'f' * n}\n",
        "long key": f"{'k' * n} = 1\n",
        "long string": f'name = "{"s" * n}"\n',
        "many tables": "".join(f"[t{k}]\n" for k in range(n // 10)),
        "huge date": "a = 9999-99-99T99:99:99\n",
        "date": "start = 2020-06-25T00:00:00\n",
        "surrogate": 'a = "\\ud800"\n',
    }
    what = _choice(rng, sorted(bombs))
    if rng.random() < 0.3:  # where a number is due
        value = bombs[what].partition("=")[2].strip() or "1"
        text = re.sub(r"height_m = [^,} ]+", lambda _: f"height_m = {value}", text, count=1)
    else:
        text = bombs[what] + text if rng.random() < 0.5 else text + "\n" + bombs[what]
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    return f"flight.toml: {what}, {n}"


def geometry(folder: Path, rng: np.random.Generator) -> str:
    """Move the antennas into shapes that say little, or nothing, of attitude."""
    path = folder / "flight.toml"
    text = path.read_text(encoding="utf-8")
    shapes = ("line", "point", "line of any direction", "two at one place", "far", "tiny")
    shape, axis = _choice(rng, shapes), rng.normal(size=3)
    count = iter(range(100))

    def place(_: re.Match[str]) -> str:
        k = next(count)
        at = {
            "line": np.array([0.0, k, 0.0]),
            "point": np.zeros(3),
            "line of any direction": k * axis,
            "two at one place": np.array([min(k, 1), 0.0, 0.0]),
            "far": 1e6 * k * axis,
            "tiny": 1e-6 * rng.normal(size=3),
        }[shape]
        return f"position_b_m = {at.tolist()}"

    head, _, tail = text.partition("\n[")
    pattern = r"position_b_m = \[[^\]]*\]"
    path.write_text(head + "\n[" + re.sub(pattern, place, tail, count=8), encoding="utf-8")
    return f"antennas: {shape}"


def _choice(rng: np.random.Generator, options):
    return options[int(rng.integers(len(options)))]


def _joined(lines: list[str]) -> str:
    return "\n".join(lines) + "\n"


def _row(lines: list[str], rng: np.random.Generator) -> int:
    return int(rng.integers(1, len(lines)))


def _odd_cell(lines, rng):
    at = _row(lines, rng)
    cells = lines[at].split(",")
    cells[int(rng.integers(len(cells)))] = _choice(rng, _HUGE)
    lines[at] = ",".join(cells)
    return _joined(lines)


def _odd_character(lines, rng):
    at = int(rng.integers(len(lines)))
    place = int(rng.integers(len(lines[at]) + 1))
    lines[at] = lines[at][:place] + _choice(rng, _CONTROL) + lines[at][place:]
    return _joined(lines)


def _time_jump(lines, rng):
    """Shift the times of one row, of all from it, or of all."""
    kind, at, jump_s = int(rng.integers(3)), _row(lines, rng), _choice(rng, _TIMES_S)
    rows = {0: [at], 1: range(at, len(lines)), 2: range(1, len(lines))}[kind]
    for k in rows:
        t_s, comma, rest = lines[k].partition(",")
        try:
            lines[k] = f"{float(t_s) + jump_s:.8f}{comma}{rest}"
        except ValueError:  # integers.csv begins with a name
            break
    return _joined(lines)


def _last_time_jumps(lines, rng):
    _, comma, rest = lines[-1].partition(",")
    lines[-1] = f"{_choice(rng, (604_800.0, 1e9, 1e6, 86_400.0, 1e15))}{comma}{rest}"
    return _joined(lines)


def _rows_lost(lines, rng):
    start = _row(lines, rng)
    del lines[start : start + int(rng.integers(1, len(lines)))]
    return _joined(lines)


def _row_twice(lines, rng):
    at = _row(lines, rng)
    return _joined([*lines[: at + 1], *lines[at:]])


def _rows_exchanged(lines, rng):
    i, j = _row(lines, rng), _row(lines, rng)
    lines[i], lines[j] = lines[j], lines[i]
    return _joined(lines)


def _without_last_line_end(lines, rng):
    text = _joined(lines)
    return text[: len(text) - int(rng.integers(1, 12))]


def _cut_between_rows(lines, rng):
    return _joined(lines[: _row(lines, rng) + 1])


def _other_line_ends(lines, rng):
    return _choice(rng, ("\r", "\r\n", "\n\r", "\n\n")).join(lines) + "\n"


def _column_of_one_value(lines, rng):
    column = int(rng.integers(1, lines[0].count(",") + 1))
    value, start = _choice(rng, ("0", "1e6", "-0.0", "1e-300", "1e9")), _row(lines, rng)
    for k in range(start, len(lines)):
        cells = lines[k].split(",")
        cells[column] = value
        lines[k] = ",".join(cells)
    return _joined(lines)


def _names_exchanged(lines, rng):
    names = lines[0].split(",")
    lines[0] = ",".join(rng.permutation(names).tolist())
    return _joined(lines)


def _name_changed(lines, rng):
    names = lines[0].split(",")
    at = int(rng.integers(len(names)))
    names[at] = _choice(rng, ("", " ", names[at].upper(), names[at][:-1], "x" * 1000, names[0]))
    lines[0] = ",".join(names)
    return _joined(lines)


_DIRT = (
    _odd_cell, _odd_cell, _odd_character, _odd_character, _time_jump, _time_jump, _last_time_jumps,
    _rows_lost, _row_twice, _rows_exchanged, _without_last_line_end, _cut_between_rows,
    _other_line_ends, _column_of_one_value, _names_exchanged, _name_changed,
)  # fmt: skip

# Values of the wrong kind, and names of files that are none.
_VALUES = (
    '"/dev/zero"', '"/proc/self/environ"', '"/etc/passwd"', '"."', '""', '"absent.csv"',
    '"a\\u0000b"', '"../../x"', f'"{"x" * 5000}"', "true", "[]", "{}", "1", "-1", '"nan"',
    "[1, 2]", '["a"]', "2020-06-25", "1e400", '"2020-06-25T00:00:00"', '"2190-06-25T00:00:00"',
)  # fmt: skip

FAMILIES: dict[str, Damage] = {
    "series": series,
    "bytes": bytes_of_any_file,
    "set-up": set_up,
    "toml": hostile_toml,
    "geometry": geometry,
}
SHARES = {"series": 0.4, "bytes": 0.3, "set-up": 0.18, "toml": 0.07, "geometry": 0.05}

"""Small RINEX files written by hand, and a slow reader that takes every field as it stands."""

import numpy as np

TYPES = {
    "G": "C1C L1C D1C S1C C2W L2W C5Q L5Q",
    "E": "C1X L1X C5X L5X",
    "C": "C2I L2I",
    "R": "C1C L1C",
}
SATELLITES = ("G05", "G12", "E07", "C11", "R03")


def line(content: str, label: str) -> str:
    return f"{content:<60s}{label}\n"


def head_3(
    version: str = "3.04", system: str = "GPS", extra: str = "", types: dict[str, str] = TYPES
) -> str:
    lines = [line(f"{version:>9s}{'':11s}{'OBSERVATION DATA':20s}M", "RINEX VERSION / TYPE")]
    for letter, names in types.items():
        content = f"{letter}  {len(names.split()):3d} {names}"
        lines.append(line(content, "SYS / # / OBS TYPES"))
    first = f"  2020     6    25     0     0    0.0000000     {system}"
    lines.append(line(first, "TIME OF FIRST OBS"))
    return "".join(lines) + extra + line("", "END OF HEADER")


def epoch_3(k: int, flag: int = 0, satellites: tuple[str, ...] = SATELLITES) -> str:
    lines = [f"> 2020 06 25 00 00 {k:2d}.0000000  {flag}{len(satellites):3d}\n"]
    for s, satellite in enumerate(satellites):
        fields = []
        for c, name in enumerate(TYPES[satellite[0]].split()):
            scale = {"D": -1e-4, "S": 2e-6}.get(name[0], 1.0)
            value = scale * (2.1e7 + 1e5 * s + 100 * k + c) + 0.125
            fields.append(f"{value:14.3f}{'1' if c == 1 and k == 1 else ' '}7")
        lines.append(satellite + "".join(fields).rstrip() + "\n")
    return "".join(lines)


def observation_3(epochs: int = 4, **header: str) -> str:
    return head_3(**header) + "".join(epoch_3(k) for k in range(epochs))


def observation_2(epochs: int = 3, satellites: int = 14) -> str:
    """RINEX 2 with six types (two lines each) and more satellites than fit one line."""
    text = line(f"{'2.11':>9s}{'':11s}{'OBSERVATION DATA':20s}M", "RINEX VERSION / TYPE")
    text += line("     6    C1    L1    P2    L2    D1    S1", "# / TYPES OF OBSERV")
    first = "  2020     6    25     0     0    0.0000000     GPS"
    text += line(first, "TIME OF FIRST OBS") + line("", "END OF HEADER")
    names = [f"G{k + 1:02d}" for k in range(satellites)]
    for k in range(epochs):
        listed = "".join(names[:12])
        text += f" 20  6 25  0  0 {k:2d}.0000000  0{satellites:3d}{listed}\n"
        for start in range(12, satellites, 12):
            text += " " * 32 + "".join(names[start : start + 12]) + "\n"
        for s in range(satellites):
            values = [2.2e7 + s, 1.1e8 + s, 2.2e7 + s + 3, 9e7 + s, -1234.5 + s, 45.25]
            fields = [f"{value + 0.125 * k:14.3f}  " for value in values]
            text += "".join(fields[:5]).rstrip() + "\n" + fields[5].rstrip() + "\n"
    return text


def values_3(text: str) -> dict[tuple[int, str, str], tuple[float, float, float, float, int]]:
    """Return code, phase, Doppler, density, lock by number of epoch, satellite and signal."""
    types: dict[str, list[str]] = {}
    lines = text.splitlines()
    letter = ""
    for k, content in enumerate(lines):
        if content[60:].strip() == "SYS / # / OBS TYPES":
            letter = content[0].strip() or letter
            types.setdefault(letter, []).extend(content[6:58].split())
        if content[60:].startswith("END OF HEADER"):
            lines = lines[k + 1 :]
            break
    found = {}
    epoch = -1
    for content in lines:
        if content[0] == ">":
            epoch += 1
            continue
        record: dict[str, list[float]] = {}
        for k, name in enumerate(types[content[0]]):
            field = content[3 + 16 * k : 17 + 16 * k].strip()
            row = record.setdefault(name[1:], [np.nan] * 4 + [0])
            value = float(field) if field else 0.0
            row["CLDS".index(name[0])] = value or np.nan
            if name[0] == "L":
                row[4] = int(content[17 + 16 * k : 18 + 16 * k].strip() or 0) & 3
        for signal, row in record.items():
            found[epoch, content[:3], signal] = tuple(row)
    return found


def message(satellite: str = "G05", shift: str = "    ", toe_s: float = 345600.0) -> str:
    """Return a RINEX 3 navigation message with an orbit of a GPS satellite."""
    orbit = [63, -89.75, 4.68e-9, -3.07, -4.76e-6, 0.00483, 5.459e-6, 5154.80, toe_s, 5.58e-9]
    orbit += [2.926, -9.31e-8, 0.9654, 278.4375, 0.8847, -8.1399e-9, -1.7179e-10, 1, 2111, 0]
    orbit += [2.0, 0, -1.909e-8, 63, toe_s, 4.0, 0, 0]
    head = f"{satellite} 2020 06 25 00 00 00"
    clock = "".join(f"{value:19.12E}" for value in (-1.3629e-4, -3.979e-12, 0.0))
    rows = [
        shift + "".join(f"{value:19.12E}" for value in orbit[k : k + 4]) for k in range(0, 28, 4)
    ]
    return "\n".join([head + clock, *rows]) + "\n"


def navigation_head(version: str = "3.04") -> str:
    first = line(f"{version:>9s}{'':11s}{'NAVIGATION DATA':20s}M", "RINEX VERSION / TYPE")
    return first + line("", "END OF HEADER")

"""A comparison as a table on screen, and below it, in short, what was lost and what to know."""

from collections import Counter
from collections.abc import Iterable

from fgnav.checks import Loss
from fgnav.evaluation.comparison import Comparison
from fgnav.evaluation.integer_counts import IntegerCounts
from fgnav.evaluation.report.blocks import NONE
from fgnav.evaluation.scores import EULER, Angles, BaselineFigures, Score, open_heading_spans_s
from fgnav.types.estimate import Rejected, Verdict

_MOST_LINES = 8
_MOST_LINKS = 3
_DOUBTFUL = 0.01  # what resolvers that accept by a probability leave out (``wrong_max``)
_HEADS = (
    ("roll", "deg"),
    ("pitch", "deg"),
    ("yaw", "deg"),
    ("angle", "deg"),
    ("azimuth", "deg"),  # of a baseline between two antennas, or of antennas in a line
    ("elevation", "deg"),
    ("position", "m"),
    ("velocity", "m/s"),
    ("NEES", "angle"),  # 3 where the stated covariance is right
    ("NEES", "place"),
    ("NEES", "speed"),
    ("NIS", "most"),  # of a kind of measurements, 1 where its noise is right
    ("epochs", "%"),
    ("fixed", "%"),
    ("wrong", "%"),
    ("chance", "%"),  # of wrong integers in an epoch, as stated
    ("time", "s"),
)


_REFERENCE = "errors and NEES are against a reference that is an estimate itself (a filter's): "
WHAT = {
    "truth": "RMS errors",
    "reference": "RMS errors against a reference",
    None: "medians of 1σ as stated, for there is no truth",
}


def score_table(comparison: Comparison) -> tuple[list[tuple[str, str]], list[list[str]]]:
    """Return names and units of columns, and rows of the methods, then of their differences.

    RMS errors or, without truth, medians of what is stated of them; columns without a figure are
    left out. NEES against a reference is called so.
    """
    is_judged = comparison.judged_by is not None
    rows = [[m.name, *_score_row(m.score, is_judged=is_judged)] for m in comparison.methods]
    for one in comparison.differences:
        figures = _angles(one.rms_deg) | {
            "angle": _figure(one.attitude_rms_deg),
            "position": _figure(one.position_rms_m),
            "velocity": _figure(one.velocity_rms_mps),
        }
        cells = [figures.get(name, "") for name, _ in _HEADS]
        rows.append([" − ".join(one.methods), *cells])
    shown = [k for k in range(len(_HEADS)) if {row[k + 1] for row in rows} - {NONE, ""}]
    nees = "NEES ref" if comparison.judged_by == "reference" else "NEES"
    heads = [(nees if name == "NEES" else name, unit) for name, unit in (_HEADS[k] for k in shown)]
    return heads, [[row[0], *(row[k + 1] for k in shown)] for row in rows]


def comparison_table(comparison: Comparison, width: int) -> list[str]:
    """Return the lines of a table of RMS errors, or, without truth, of sigmas and differences.

    Columns that are too many for ``width`` go below each other, under the methods' names again;
    nothing is cut short.
    """
    heads, rows = score_table(comparison)
    split: list[list[str]] = []
    for name, *figures in rows:
        *above, last = name.split(" − ")
        split += [[f"RMS of {one}"] for one in above] + [[f"− {last}" if above else last, *figures]]
    bound = {name: value for name, value in _angles(comparison.bound).items() if value != NONE}
    bounds = [bound.get(name, "") for name, _ in heads]
    split += [["bound of one epoch", *bounds]] if bound else []
    title = f"{comparison.flight}: {WHAT[comparison.judged_by]}, {comparison.epochs} epochs"
    columns = [["method", *(name for name, _ in heads)], ["", *(unit for _, unit in heads)]]
    return [title, *folded_table(columns, split, width)]


def folded_table(heads: list[list[str]], rows: list[list[str]], width: int) -> list[str]:
    """Return aligned lines, the columns in as many bands as the width asks for, each with names."""
    cells = [row + [""] * (len(heads[0]) - len(row)) for row in (*heads, *rows)]
    of_columns = [row for row in cells if any(row[1:])]  # others may go beyond the first
    wide = [max(map(len, column)) for column in zip(*of_columns, strict=True)]
    bands, room = [[0]], width - wide[0]
    for column in range(1, len(wide)):
        room -= wide[column] + 1
        if room < 0 and len(bands[-1]) > 1:
            bands.append([0])
            room = width - wide[0] - wide[column] - 1
        bands[-1].append(column)
    lines = []
    for band in bands:
        shown = [
            " ".join([row[0].ljust(wide[0]), *(row[k].rjust(wide[k]) for k in band[1:])])
            for row in cells
            if row in cells[: len(heads)] or any(row[k] for k in band[1:]) or not any(row[1:])
        ]
        lines += [*shown[: len(heads)], "─" * len(shown[0]), *shown[len(heads) :], ""]
    return [line.rstrip() for line in lines[:-1]]


def quality_lines(comparison: Comparison) -> list[str]:
    """Return lines on how well each method knows a flight: medians of 1σ, errors, open heading."""
    lines = []
    for method in comparison.solved:
        kinds = {
            "1σ (median)": _stated_uncertainty(method.score),
            "RMS errors": _errors(method.score),
        }
        lines += [f"{method.name}: {kind}: {', '.join(of)}" for kind, of in kinds.items() if of]
        spans_s = [] if method.estimate is None else open_heading_spans_s(method.estimate)
        if spans_s:
            total_s = sum(b - a for a, b in spans_s)
            first = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in spans_s[:_MOST_LINKS])
            more = " and more" if len(spans_s) > _MOST_LINKS else ""
            lines.append(f"{method.name}: heading is open {first}{more} s, {total_s:.1f} s in all")
    return lines


def _stated_uncertainty(score: Score) -> list[str]:
    """Return medians of 1-sigma as stated, each with its name and unit."""
    of = score.sigmas
    figures = [(name, getattr(of.euler_deg, name), "deg") for name in EULER]
    for one in score.baselines:
        figures.append((f"azimuth of {one.name}", one.azimuth_sigma_deg, "deg"))
        figures.append((f"elevation of {one.name}", one.elevation_sigma_deg, "deg"))
    figures += [("position", of.position_m, "m"), ("velocity", of.velocity_mps, "m/s")]
    return [f"{name} {_figure(value)} {unit}" for name, value, unit in figures if value is not None]


def _errors(score: Score) -> list[str]:
    """Return RMS errors, each with its name, unit and NEES."""
    figures = (
        ("attitude", score.attitude_rmse_deg, "deg", score.attitude_nees_mean),
        ("position", score.position_rmse_m, "m", score.position_nees_mean),
        ("velocity", score.velocity_rmse_mps, "m/s", score.velocity_nees_mean),
    )
    return [
        f"{name} {_figure(value)} {unit}" + ("" if nees is None else f" (NEES {nees:.2f} of 3)")
        for name, value, unit, nees in figures
        if value is not None
    ] + [
        f"{angle} of {one.name} {_figure(value)} deg"
        for one in score.baselines
        for angle, value in (
            ("azimuth", one.azimuth_rmse_deg),
            ("elevation", one.elevation_rmse_deg),
        )
        if value is not None
    ]


def remarks(comparison: Comparison) -> list[str]:
    """Return a line per failure, open state, note, kind of rejection and group of losses."""
    lines = [_REFERENCE + _counted(comparison)] if comparison.judged_by == "reference" else []
    for method in comparison.methods:
        score = method.score
        if score.failure is not None:
            lines.append(f"{method.name}: no solution: {score.failure}")
        elif not score.converged:
            lines.append(f"{method.name}: did not converge; its figures are not to be trusted")
    lines += _by_method((m.name, verdict_lines(m.score.verdicts)) for m in comparison.methods)
    lines += _by_method(
        (m.name, tuple(f"{state} is unobservable" for state in m.score.unobservable))
        for m in comparison.methods
    )
    lines += _by_method((m.name, _doubt(m.score.integers)) for m in comparison.methods)
    complete = [m for m in comparison.methods if " without " not in m.name]  # they say it, too
    lines += _by_method((m.name, m.score.notes) for m in complete or comparison.methods)
    lines += _by_method((m.name, rejection_lines(m.rejections)) for m in comparison.methods)
    per_method = {m.name: m.score.losses for m in comparison.solved}
    return lines + loss_lines(per_method)


def _counted(comparison: Comparison) -> str:
    sigmas = comparison.counted_sigmas
    if not sigmas:
        return "it states no sigmas, so that its errors count as the methods'"
    return f"its own sigmas of {', '.join(sigmas)} are counted, as if independent"


def _doubt(counts: IntegerCounts | None) -> tuple[str, ...]:
    """Return a warning where a resolver accepts integers that it holds for wrong too often."""
    if counts is None or counts.chance is None or counts.chance <= _DOUBTFUL:
        return ()
    return (
        f"an epoch's integers are wrong with a chance of {100 * counts.chance:.2g} %, as their "
        "resolver states it, and attitudes are no surer; constrained-arcs leaves such epochs out",
    )


def verdict_lines(verdicts: tuple[Verdict, ...]) -> tuple[str, ...]:
    """Return a line per sensor that contradicts the others: its largest verdict."""
    largest: dict[str, Verdict] = {}
    for one in verdicts:
        largest.setdefault(one.sensor, one)
    return tuple(f"inconsistent: {one}" for one in largest.values())


def rejection_lines(rejections: tuple[Rejected, ...]) -> tuple[str, ...]:
    """Return a line per kind of measurement that was mended or not believed, with who made it."""
    links: dict[str, list[str]] = {}
    for one in rejections:
        links.setdefault(one.what, []).append(one.link)
    return tuple(
        f"{what} contradicted the rest {len(by)} times ({_some(by)}): mended or left out, each "
        "in --json"
        for what, by in links.items()
    )


def _some(links: list[str]) -> str:
    """Return who was rejected most often, and how many others were."""
    ranked = [link for link, _ in Counter(links).most_common()]
    more = len(ranked) - _MOST_LINKS
    return ", ".join(ranked[:_MOST_LINKS]) + (f" and {more} more" if more > 0 else "")


def loss_lines(per_owner: dict[str, tuple[Loss, ...]]) -> list[str]:
    """Return losses grouped by reason, the most frequent first, and how many groups are not shown.

    Parameters
    ----------
    per_owner : dict of str to tuple of Loss
        By who lost them; the same loss of several owners is told once.
    """
    counts: dict[str, Counter[str]] = {}
    for owner, losses in per_owner.items():
        for loss in losses:
            counts.setdefault(loss.reason, Counter())[owner] += loss.count
    kinds: dict[str, dict[str, None]] = {}
    for losses in per_owner.values():
        for loss in losses:
            kinds.setdefault(loss.reason, {})[loss.what] = None
    ranked = sorted(counts.items(), key=lambda item: -max(item[1].values()))
    lines = []
    for reason, by_owner in ranked[:_MOST_LINES]:
        low, high = min(by_owner.values()), max(by_owner.values())
        number = f"{high}" if low == high else f"{low} to {high}"
        owners = "" if by_owner.keys() == per_owner.keys() else f" ({', '.join(by_owner)})"
        what, *others = kinds[reason]
        what += " and others" if others else ""
        lines.append(f"lost {number} × {what}: {reason}{owners}")
    if len(ranked) > _MOST_LINES:
        lines.append(f"and {len(ranked) - _MOST_LINES} more reasons for losses, all in --json")
    return lines


def _by_method(sayings: Iterable[tuple[str, tuple[str, ...]]]) -> list[str]:
    """Return each saying once, with all who said it."""
    speakers: dict[str, list[str]] = {}
    for name, texts in sayings:
        for text in texts:
            speakers.setdefault(text, []).append(name)
    return [f"{', '.join(names)}: {text}" for text, names in speakers.items()]


def _score_row(score: Score, *, is_judged: bool) -> list[str]:
    """Return a method's figures under ``_HEADS``."""
    if score.failure is not None:
        return [NONE] * (len(_HEADS) - 1) + [f"{score.seconds:.2f}"]
    line, stated = next(iter(score.baselines), BaselineFigures(name="")), score.sigmas
    if is_judged:
        angles, place_m, speed_mps = score.rmse_deg, score.position_rmse_m, score.velocity_rmse_mps
        of_line = line.azimuth_rmse_deg, line.elevation_rmse_deg
    else:
        angles, place_m, speed_mps = stated.euler_deg, stated.position_m, stated.velocity_mps
        of_line = line.azimuth_sigma_deg, line.elevation_sigma_deg
    return [
        *_angles(angles).values(),
        _figure(score.attitude_rmse_deg),
        *map(_figure, of_line),
        _figure(place_m),
        _figure(speed_mps),
        _attitude_nees(score),
        _figure(score.position_nees_mean, digits=2),
        _figure(score.velocity_nees_mean, digits=2),
        _figure(max((one.nis for one in score.consistency), default=None), digits=2),
        f"{100 * score.available:.1f}",
        *_integers(score.integers),
        f"{score.seconds:.2f}",
    ]


def _attitude_nees(score: Score) -> str:
    """Return the NEES of three angles, or of the direction of antennas in a line."""
    nees = next((one.nees_mean for one in score.baselines), None)
    if score.attitude_nees_mean is None and nees is not None:
        return f"{nees:.2f} of 2"
    return _figure(score.attitude_nees_mean, digits=2)


def _integers(counts: IntegerCounts | None) -> list[str]:
    """Return the share of fixed links, of wrong ones among them, and the stated chance of such."""
    if counts is None:
        return [NONE, NONE, NONE]
    links = counts.fixed + counts.not_fixed
    fixed = f"{100 * counts.fixed / links:.1f}" if links else NONE
    chance = NONE if counts.chance is None else f"{100 * counts.chance:.2f}"
    if counts.wrong is None or counts.right is None or not counts.right + counts.wrong:
        return [fixed, NONE, chance]
    return [fixed, f"{100 * counts.wrong / (counts.right + counts.wrong):.2f}", chance]


def _angles(figures: Angles) -> dict[str, str]:
    return {name: _figure(getattr(figures, name)) for name in EULER}


def _figure(value: float | None, digits: int = 3) -> str:
    """Return a figure with fixed decimals, so that columns align; large ones without."""
    if value is None:
        return NONE
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.0f}"

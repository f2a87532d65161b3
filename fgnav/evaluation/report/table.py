"""A comparison as a table on screen, and below it, in short, what was lost and what to know."""

from collections import Counter
from collections.abc import Iterable

from fgnav.checks import Loss
from fgnav.evaluation.comparison import Comparison
from fgnav.evaluation.integer_counts import IntegerCounts
from fgnav.evaluation.report.blocks import NONE
from fgnav.evaluation.scores import Angles, Score
from fgnav.types.estimate import Rejected, Verdict

_MOST_LINES = 8
_MOST_LINKS = 3
_DOUBTFUL = 0.01  # what resolvers that accept by a probability leave out (``wrong_max``)
_HEADS = (
    ("roll", "deg"),
    ("pitch", "deg"),
    ("yaw", "deg"),
    ("angle", "deg"),
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
_WHAT = {"truth": "RMS errors", "reference": "RMS errors against a reference", None: "no truth"}


def heads(comparison: Comparison) -> list[tuple[str, str]]:
    """Return names and units of a score's figures; NEES against a reference is called so."""
    nees = "NEES ref" if comparison.judged_by == "reference" else "NEES"
    return [(nees if name == "NEES" else name, unit) for name, unit in _HEADS]


def comparison_table(comparison: Comparison, width: int) -> list[str]:
    """Return the lines of a table of RMS errors, or, without truth, of differences between methods.

    Columns that are too many for ``width`` go below each other, under the methods' names again;
    nothing is cut short.
    """
    rows = [[method.name, *score_row(method.score)] for method in comparison.methods]
    for difference in comparison.differences:
        first, second = difference.methods
        figures = [
            *_angles(difference.rms_deg),
            _figure(difference.attitude_rms_deg),
            _figure(difference.position_rms_m),
            _figure(difference.velocity_rms_mps),
        ]
        rows += [[first], [f"− {second}", *figures]]
    rows.append(["bound of one epoch", *_angles(comparison.bound)])
    title = f"{comparison.flight}: {_WHAT[comparison.judged_by]}, {comparison.epochs} epochs"
    names, units = zip(*heads(comparison), strict=True)
    return [title, *folded_table([["method", *names], ["", *units]], rows, width)]


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


def score_row(score: Score) -> list[str]:
    """Return a method's figures under ``heads``."""
    if score.failure is not None:
        return [NONE] * (len(_HEADS) - 1) + [f"{score.seconds:.2f}"]
    return [
        *_angles(score.rmse_deg),
        _figure(score.attitude_rmse_deg),
        _figure(score.position_rmse_m),
        _figure(score.velocity_rmse_mps),
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
    if score.attitude_nees_mean is None and score.line_nees_mean is not None:
        return f"{score.line_nees_mean:.2f} of 2"
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


def _angles(figures: Angles) -> list[str]:
    return [_figure(figures.roll), _figure(figures.pitch), _figure(figures.yaw)]


def _figure(value: float | None, digits: int = 3) -> str:
    """Return a figure with fixed decimals, so that columns align; large ones without."""
    if value is None:
        return NONE
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.0f}"

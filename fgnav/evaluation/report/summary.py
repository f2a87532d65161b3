"""A comparison as a table, and in lines what was lost and what to know."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from fgnav.checks import Unused
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.report.parts import NONE, Table
from fgnav.evaluation.scores import EULER, Angles, BaselineFigures, Score, open_heading_spans_s
from fgnav.messages import by_severity
from fgnav.types.estimate import Verdict

_MOST_LINES = 8
_LISTED = 5  # messages of a method
_MOST_LINKS = 3
_DOUBTFUL = 0.01  # what resolvers that accept by a probability leave out (``wrong_max``)
HEADS = (
    *("roll, deg", "pitch, deg", "yaw, deg", "angle, deg"),
    *("azimuth, deg", "elevation, deg"),  # of antennas in a line
    *("position, m", "velocity, m/s"),
    *("NEES, angle", "NEES, place", "NEES, speed"),  # 3 where the stated covariance is right
    "NIS, most",  # of a kind of measurements, 1 where its noise is right
    *("epochs, %", "fixed, %", "wrong, %"),
    "chance, %",  # of wrong integers in an epoch, as stated
    "time, s",
)


_REFERENCE = "errors and NEES are against a reference that is an estimate itself (a filter's): "
_JUDGED = {
    "truth": "RMS errors",
    "reference": "RMS errors against a reference",
    None: "medians of 1σ as stated, for there is no truth",
}


def method_table(comparison: Comparison) -> Table:
    """Return a row for each method, for each difference of two, and for each bound.

    RMS errors or, without truth, medians of what is stated of them; columns without a figure are
    left out. NEES against a reference is called so.
    """
    rows = {m.name: _score_row(m.score, comparison.judged_by) for m in comparison.methods}
    for difference in comparison.differences:
        rows[" − ".join(difference.methods)] = _angles(difference.rms_deg) | {
            "angle, deg": _figure(difference.attitude_rms_deg),
            "position, m": _figure(difference.position_rms_m),
            "velocity, m/s": _figure(difference.velocity_rms_mps),
        }
    for name, bound in (
        ("one epoch", comparison.bound),
        ("the flight", comparison.posterior_bound),
    ):
        if bound != Angles():
            rows[f"bound of {name}"] = _angles(bound)
    shown = [head for head in HEADS if {row.get(head, "") for row in rows.values()} - {NONE, ""}]
    heads = [head.replace("NEES", "NEES ref") for head in shown]
    return Table(
        ["method", *(heads if comparison.judged_by == "reference" else shown)],
        [[name, *(row.get(head, "") for head in shown)] for name, row in rows.items()],
        f"{comparison.flight}: {_JUDGED[comparison.judged_by]}, {comparison.epochs} epochs",
    )


def remarks(comparison: Comparison) -> list[str]:
    """Return a line per failure, open state, note, kind of rejection and group of unused."""
    lines = [_REFERENCE + _counted(comparison)] if comparison.judged_by == "reference" else []
    methods = comparison.methods
    for kind in (_failure, _verdicts, _unobservable, _open_heading, _reservations):
        lines += _by_method({m.name: kind(m) for m in methods})
    complete = [m for m in methods if " without " not in m.name]  # they say it, too
    lines += _by_method({m.name: _foremost(m.score.notes) for m in complete or methods})
    lines += _by_method({m.name: _rejections(m) for m in methods})
    return lines + unused_lines({m.name: m.score.unused for m in comparison.solved})


def _foremost(notes: Sequence[str]) -> list[str]:
    """Return the worst messages, and how many there are besides."""
    lines = by_severity(notes)
    more = len(lines) - _LISTED
    if more <= 0:
        return lines
    return [*lines[:_LISTED], f"{more} more messages: --json lists them."]


def _by_method(lines: Mapping[str, Iterable[str]]) -> list[str]:
    """Return each line once, with all methods that it holds of."""
    methods: dict[str, list[str]] = {}
    for name, texts in lines.items():
        for text in texts:
            methods.setdefault(text, []).append(name)
    return [f"{', '.join(names)}: {text}" for text, names in methods.items()]


def _counted(comparison: Comparison) -> str:
    sigmas = comparison.counted_sigmas
    if not sigmas:
        return "it states no sigmas, so that its errors count as the methods'"
    return f"its own sigmas of {', '.join(sigmas)} are counted, as if independent"


def _failure(method: Method) -> Iterator[str]:
    if method.score.failure is not None:
        yield f"no solution: {method.score.failure}"
    elif not method.score.converged:
        yield "did not converge; its figures are not to be trusted"


def _verdicts(method: Method) -> Iterator[str]:
    """Yield a line per sensor that contradicts the others: its largest verdict."""
    largest: dict[str, Verdict] = {}
    for verdict in method.score.verdicts:
        largest.setdefault(verdict.sensor, verdict)
    yield from (f"inconsistent: {verdict}" for verdict in largest.values())


def _unobservable(method: Method) -> Iterator[str]:
    yield from (f"{state} is unobservable" for state in method.score.unobservable)


def _open_heading(method: Method) -> Iterator[str]:
    """Yield where yaw is known to no better than a guess."""
    spans_s = [] if method.estimate is None else open_heading_spans_s(method.estimate)
    if spans_s:
        first = ", ".join(f"{a:.1f} to {b:.1f}" for a, b in spans_s[:_MOST_LINKS])
        more = " and more" if len(spans_s) > _MOST_LINKS else ""
        yield f"heading is open {first}{more} s, {sum(b - a for a, b in spans_s):.1f} s in all"


def _reservations(method: Method) -> Iterator[str]:
    """Yield a warning where a resolver accepts integers that are wrong too often."""
    counts = method.score.integers
    if counts is not None and counts.chance is not None and counts.chance > _DOUBTFUL:
        yield (
            f"an epoch's integers are wrong with a chance of {100 * counts.chance:.2g} %, as their "
            "resolver states it, and attitudes are no surer; constrained-arcs leaves such epochs "
            "out"
        )


def _rejections(method: Method) -> Iterator[str]:
    """Yield a line per kind of measurement that was mended or left out, with its links."""
    links: dict[str, Counter[str]] = {}
    for rejected in method.rejections:
        links.setdefault(rejected.what, Counter())[rejected.link] += 1
    for what, by_link in links.items():
        most = ", ".join(link for link, _ in by_link.most_common(_MOST_LINKS))
        more = len(by_link) - _MOST_LINKS
        yield (
            f"{what} contradicted the rest {by_link.total()} times ({most}"
            f"{f' and {more} more' if more > 0 else ''}): mended or left out, each in --json"
        )


def unused_lines(per_owner: Mapping[str, Sequence[Unused]]) -> list[str]:
    """Return unused grouped by reason, the most frequent first, and how many groups are not shown.

    Parameters
    ----------
    per_owner : dict of str to sequence of Unused
        By who lost them; the same loss of several owners is told once.
    """
    counts: dict[str, Counter[str]] = {}
    kinds: dict[str, dict[str, None]] = {}
    for owner, unused in per_owner.items():
        for loss in unused:
            counts.setdefault(loss.reason, Counter())[owner] += loss.count
            kinds.setdefault(loss.reason, {})[loss.what] = None
    ranked = sorted(counts.items(), key=lambda item: -max(item[1].values()))
    lines = []
    for reason, by_owner in ranked[:_MOST_LINES]:
        low, high = min(by_owner.values()), max(by_owner.values())
        number = f"{high}" if low == high else f"{low} to {high}"
        owners = "" if by_owner.keys() == per_owner.keys() else f" ({', '.join(by_owner)})"
        what, *others = kinds[reason]
        lines.append(f"lost {number} × {what}{' and others' if others else ''}: {reason}{owners}")
    if len(ranked) > _MOST_LINES:
        lines.append(f"and {len(ranked) - _MOST_LINES} more reasons, all in --json")
    return lines


def _score_row(score: Score, judged_by: str | None) -> dict[str, str]:
    """Return a method's figures by ``HEADS``."""
    line, sigmas = next(iter(score.baselines), BaselineFigures(name="")), score.sigmas
    counts = score.integers
    if judged_by is not None:
        angles, position_m, velocity_mps = (
            score.rmse_deg,
            score.position_rmse_m,
            score.velocity_rmse_mps,
        )
        of_line = line.azimuth_rmse_deg, line.elevation_rmse_deg
    else:
        angles, position_m, velocity_mps = sigmas.euler_deg, sigmas.position_m, sigmas.velocity_mps
        of_line = line.azimuth_sigma_deg, line.elevation_sigma_deg
    nees = _figure(score.attitude_nees_mean, 2)
    if score.attitude_nees_mean is None and line.nees_mean is not None:
        nees = f"{line.nees_mean:.2f} of 2"
    counted = None if counts is None or counts.right is None else counts.right + (counts.wrong or 0)
    cells = [
        *_angles(angles).values(),
        *map(_figure, (score.attitude_rmse_deg, *of_line, position_m, velocity_mps)),
        nees,
        _figure(score.position_nees_mean, 2),
        _figure(score.velocity_nees_mean, 2),
        _figure(max((test.nis for test in score.consistency), default=None), 2),
        NONE if score.failure is not None else f"{100 * score.available:.1f}",
        NONE if counts is None else _share(counts.fixed, counts.fixed + counts.not_fixed, 1),
        NONE if counts is None else _share(counts.wrong, counted, 2),
        NONE if counts is None else _share(counts.chance, 1, 2),
        f"{score.seconds:.2f}",
    ]
    return dict(zip(HEADS, cells, strict=True))


def _share(count: float | None, of: float | None, digits: int) -> str:
    return NONE if count is None or not of else f"{100 * count / of:.{digits}f}"


def _angles(figures: Angles) -> dict[str, str]:
    return {f"{name}, deg": _figure(getattr(figures, name)) for name in EULER}


def _figure(value: float | None, digits: int = 3) -> str:
    """Return a figure with fixed decimals, so that columns align; large ones without."""
    if value is None:
        return NONE
    return f"{value:.{digits}f}" if abs(value) < 1000 else f"{value:.0f}"

"""A campaign from its order to its tables."""

from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from fgnav.campaign.engines import DIED, Engine
from fgnav.campaign.fly import Record, check_order, failed, fly
from fgnav.campaign.folder import Folder
from fgnav.campaign.order import Order, Run
from fgnav.campaign.report import write_report
from fgnav.campaign.tables import write_tables
from fgnav.checks import BadInputError, Unused
from fgnav.evaluation.report.parts import Report
from fgnav.progress import report

_KINDS = 5  # of failures that are named


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Outcome of a campaign."""

    # asked, kept, flown: runs of the order, those with a file now, those flown by this call
    asked: int
    kept: int
    flown: int
    unused: tuple[Unused, ...]  # runs that came to nothing, with the reason
    text: str  # the report as text
    report: Report  # the same as parts, for other formats
    files: tuple[Path, ...] = field(default=())


def conduct(order: Order, out: Path, engine: Engine, *, resume: bool = False) -> Outcome:
    """Fly all runs of an order that are not there yet; write their files, tables and report.

    Parameters
    ----------
    out : Path
        Folder for all that.
    resume : bool
        Whether to go on where an earlier call stopped.

    Raises
    ------
    BadInputError
        Before any run starts, if a method or a case cannot be had or the folder is taken.
    """
    check_order(order)
    folder = Folder(out, order, resume=resume)
    todo = folder.missing()
    flown, unwritten = 0, Counter[str]()
    for run, record in engine(partial(_fly, order), todo, partial(_lost, order)):
        flown += 1
        try:
            folder.keep(run, record)
        except BadInputError as error:
            unwritten[str(error).partition(": ")[2]] += 1
        report(1.0 - (len(todo) - flown) / order.count)
    files = write_tables(order, folder, out)
    text, page = write_report(order, folder, out)
    failures = Counter(record["failure"] for record in folder)
    return Outcome(
        asked=order.count,
        kept=failures.total(),
        flown=flown,
        unused=(*_failures(failures), *_unused("run not kept", unwritten)),
        text=text,
        report=page,
        files=files,
    )


def _fly(order: Order, run: Run) -> tuple[Run, Record]:
    return run, fly(order, run)


def _lost(order: Order, run: Run) -> tuple[Run, Record]:
    return run, failed(order, run, DIED)


def _failures(counted: "Counter[str | None]") -> tuple[Unused, ...]:
    reasons = Counter({why: n for why, n in counted.items() if why})
    return _unused("run failed", reasons)


def _unused(what: str, reasons: "Counter[str]") -> tuple[Unused, ...]:
    named = [Unused(what=what, reason=why, count=n) for why, n in reasons.most_common(_KINDS)]
    others = sum(reasons.values()) - sum(loss.count for loss in named)
    if others:
        named.append(Unused(what=what, reason="other reasons", count=others))
    return tuple(named)

"""Commands that are killed at random times: nothing torn, nothing left, the same bytes after all.

Commands run in forks of this process, which has every module and kernel already: a run takes tenths
of a second, so that kills fall into all of its parts.
"""

import hashlib
import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fgnav import cli
from fgnav.io.exports.tables import ESTIMATE, SUMMARY


@dataclass(frozen=True)
class Command:
    """A command line by the folder for its results, and whether what it left there is torn."""

    name: str
    arguments: Callable[[Path], list[str]]
    is_torn: Callable[[Path], bool]
    repeats: bool = True  # may be called again where it has finished


def commands(flight: Path, scenario: Path, world: Path) -> tuple[Command, ...]:
    """Return the commands that write."""
    run = ["run", str(flight), "--method", "closed-form", "--out"]
    simulate = ["simulate", str(scenario), "--seed", "3", "--batch", "3", "--out"]
    draw = ["data-set", str(world), "--seed", "3", "--out"]
    compare = ["compare", str(flight), "--method", "closed-form,rtk", "--json"]
    return (
        Command("run", lambda out: [*run, str(out / "results")], _is_torn_outcome),
        Command("compare", lambda out: [*compare, str(out / "a.json")], _is_torn_json),
        Command("simulate", lambda out: [*simulate, str(out / "batch")], _never, repeats=False),
        Command("data-set", lambda out: [*draw, str(out / "set")], _never, repeats=False),
    )


def commands_of_models() -> tuple[Command, ...]:
    """Return the commands that write networks."""
    train = ["train", "gravity", "--scale", "smoke", "--resume", "--out"]
    return (Command("train", lambda out: [*train, str(out / "nets")], _never),)


def killed(
    command: Command, times: int, scratch: Path, rng: np.random.Generator
) -> tuple[list[str], int]:
    """Kill a command again and again; return what was wrong, and how often it was still running."""
    right, out = scratch / "right", scratch / "killed"
    shutil.rmtree(scratch, ignore_errors=True)
    right.mkdir(parents=True)
    started = time.monotonic()
    assert _forked(command.arguments(right)) == 0
    lasts_s = time.monotonic() - started
    faults, hits = [], 0
    for _ in range(times):
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        after_s = float(rng.uniform(0.0, lasts_s))
        status = _forked(command.arguments(out), after_s)
        hits += status == -signal.SIGKILL
        if command.is_torn(out):
            faults.append(f"{command.name}: torn after {after_s:.3f} s")
        finished = status == 0 or _content(out) == _content(right)
        if (command.repeats or not finished) and _forked(command.arguments(out)) != 0:
            faults.append(f"{command.name}: cannot go on after {after_s:.3f} s")
        elif _content(out) != _content(right):
            faults.append(f"{command.name}: other bytes after {after_s:.3f} s")
    return faults, hits


def _forked(arguments: list[str], kill_after_s: float | None = None) -> int:
    """Run a command in a fork; return its exit status, or minus the signal that ended it."""
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if not pid:
        status = 99
        try:
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            os.dup2(quiet, 2)
            sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115
            status = cli.main(arguments)
        finally:
            os._exit(status)
    if kill_after_s is not None:
        time.sleep(kill_after_s)
        os.kill(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def _content(folder: Path) -> dict[str, bytes]:
    """Return the bytes of all files by name; of summaries and figures their names alone.

    Those hold wall times.
    """
    return {
        str(path.relative_to(folder)): b"" if _has_times(path) else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _has_times(path: Path) -> bool:
    return path.name in (SUMMARY, "a.json")


def _is_torn_outcome(out: Path) -> bool:
    """Tell whether a summary speaks of another estimate than the one beside it."""
    if not (out / "results" / SUMMARY).exists():
        return False
    summary = json.loads((out / "results" / SUMMARY).read_bytes())
    estimate = (out / "results" / ESTIMATE).read_bytes()
    return bool(summary["estimate"]["sha256"] != hashlib.sha256(estimate).hexdigest())


def _is_torn_json(out: Path) -> bool:
    path = out / "a.json"
    return path.exists() and not path.read_text(encoding="utf-8").endswith("}\n")


def _never(_out: Path) -> bool:
    """Tell nothing: a folder that is there is compared with the right one byte by byte."""
    return False

"""A campaign as tables and as pictures that correspond to the paper's Figures 3 to 14."""

import json
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from fgnav.checks import FloatArray, IntArray
from fgnav.io.atomic_write import write_text
from fgnav_models.training.ambiguity import figures as draw
from fgnav_models.training.ambiguity.baselines import Figures
from fgnav_models.training.ambiguity.experiment import Result
from fgnav_models.training.ambiguity.failures import (
    LONGEST,
    conditional_percent,
    independent_joint_failures,
    joint_failures,
    run_lengths,
    shuffled_run_lengths,
)
from fgnav_models.training.ambiguity.phases import Campaign, Findings, find
from fgnav_models.training.order import Order, markdown_table
from fgnav_models.training.recipes import scaled

_SHUFFLES = 2  # stream of random numbers
_LEAST = 1e-2  # of counts to be drawn, whose means over draws may be smaller


def run(order: Order) -> list[str]:
    """Run the phases of a recipe; a ``fgnav_models.training.order.Trainer``.

    Writes ``report.md``, ``summary.json`` and ``figure_03.png`` …
    """
    findings = find(scaled(order, Campaign), order)
    sections = [
        *_summary(findings, order),
        *_phase_1(findings, order.out),
        *_phase_2(findings, order.out),
        *_phase_3(findings, order.out),
        *_phase_4(findings, order.out),
        *_failures(findings, order.out),
    ]
    write_text(order.out / "report.md", "\n\n".join(sections) + "\n")
    write_text(order.out / "summary.json", json.dumps(_plain(findings, order), indent=1) + "\n")
    names = [
        f"{task} {_percent(e.accuracy_percent.mean())}" for task, e in findings.ensembles.items()
    ]
    rounding = findings.final_baselines["rounding"].accuracy_percent.mean()
    return [
        f"{findings.campaign.name}: mean accuracy of the final networks: {', '.join(names)}; "
        f"rounding {_percent(rounding)}",
        f"tables and figures are in {order.out / 'report.md'}",
    ]


def _plain(findings: Findings, order: Order) -> dict[str, Any]:
    """Return the campaign's figures, small enough to be kept, and what they were made on."""
    cuda = order.device == "cuda"
    return {
        "name": findings.campaign.name,
        "scale": order.scale,
        "hardware": torch.cuda.get_device_name() if cuda else f"CPU {platform.machine()}",
        "training_s": round(sum(result.seconds for result in findings.results.values()), 1),
        "benchmark": {
            key: {
                "accuracy_percent": round(best_test(result, "accuracy_percent"), 3),
                "rows": result.rows,
            }
            for key, result in findings.results.items()
        },
        "final": {
            task: {
                "accuracy_percent": ensemble.accuracy_percent.round(3).tolist(),
                "rounds": ensemble.rounds.tolist(),
            }
            for task, ensemble in findings.ensembles.items()
        },
        "final_baselines": {
            name: of.accuracy_percent.round(3).tolist()
            for name, of in findings.final_baselines.items()
        },
    }


def best_test(result: Result, figure: str) -> float:
    """Return a figure on the test rows, of the repetition that is best on the validation rows."""
    best = int(np.argmax(result.validation["accuracy_percent"]))
    value = result.test[figure][best]
    return float("nan") if value is None else float(value)


def baseline_rows(baselines: dict[str, Figures], column: int | None = None) -> list[list[str]]:
    """Return a table's rows: accuracy of each baseline, of one difference or the mean of all."""
    rows = []
    for name, f in baselines.items():
        of = f.accuracy_percent if column is None else f.accuracy_percent[column : column + 1]
        rows.append([name, _percent(float(of.mean())), _percent(f.all_right_percent)])
    return rows


def _summary(findings: Findings, order: Order) -> list[str]:
    campaign = findings.campaign
    noise, data = campaign.world.noise, campaign.data
    seconds = sum(result.seconds for result in findings.results.values())
    rows = baseline_rows(findings.baselines, campaign.start.benchmark)
    return [
        f"# {campaign.name}, scale {order.scale}",
        f"Inputs: {', '.join(data.inputs)}; code noise {noise.code_m} m, phase noise "
        f"{noise.phase_m} m per link; {data.epochs} epochs, split by {data.split}. Phases 1 to 3: "
        f"{len(findings.results)} experiments, {seconds:.0f} s of training. What was chosen was "
        "chosen on validation rows; every figure below is of test rows.",
        "What needs no network, on the benchmark's double difference:",
        markdown_table(("answer", "right, %", "all differences of an epoch right, %"), rows),
        *findings.unused,
    ]


def _phase_1(findings: Findings, out: Path) -> list[str]:
    grid = findings.campaign.grid
    wanted = {
        3: ("accuracy_percent", "right, %"),
        4: ("mse_failed_normalised", "normalised MSE of failures"),
        5: ("mse_total_normalised", "normalised MSE of all"),
    }
    curves: dict[int, dict[str, FloatArray]] = {
        number: {
            f"{task} {kind}": np.array(
                [best_test(findings.results[f"1/{task}-{kind}-k{k}"], figure) for k in grid.windows]
            )
            for task in grid.tasks
            for kind in grid.types
        }
        for number, (figure, _) in wanted.items()
    }
    levels = {
        name: float(findings.baselines[name].accuracy_percent[findings.campaign.start.benchmark])
        for name in ("rounding", "majority")
    }
    for number, (_, label) in wanted.items():
        draw.lines(
            out / f"figure_{number:02d}.png",
            {name: (np.array(grid.windows), values) for name, values in curves[number].items()},
            ("window, samples", label),
            levels=levels if number == 3 else {},
        )
    rows = [
        [name, *(_percent(v) for v in values), *(f"{v:.3g}" for v in curves[4][name])]
        for name, values in curves[3].items()
    ]
    heads = [f"k = {k}, %" for k in grid.windows] + [f"k = {k}, MSE" for k in grid.windows]
    return [
        "## Phase 1: task, type, window (Figures 3-5)",
        markdown_table(("network", *heads), rows),
    ]


def _phase_2(findings: Findings, out: Path) -> list[str]:
    names = {"classification": ("accuracy_percent", 6), "regression": ("mse_failed_normalised", 7)}
    sections = ["## Phase 2: architecture (Figures 6-8)"]
    for task in findings.campaign.grid.tasks:
        figure, number = names[task]
        results = _with_prefix(findings, f"2/{task}-")
        values = {name: best_test(result, figure) for name, result in results.items()}
        draw.bars(out / f"figure_{number:02d}.png", values, f"{task}: {figure}".replace("_", " "))
        spreads = {name: _spread(result, figure) for name, result in results.items()}
        if task == "regression":
            draw.bars(out / "figure_08.png", spreads, "worst minus best repetition")
        rows = [[name, f"{values[name]:.4g}", f"{spreads[name]:.3g}"] for name in values]
        sections += [markdown_table((f"{task}", figure.replace("_", " "), "spread"), rows)]
    return sections


def _phase_3(findings: Findings, out: Path) -> list[str]:
    sections = ["## Phase 3: learning rate (Figure 9)"]
    for task in findings.campaign.grid.tasks:
        results = _with_prefix(findings, f"3/{task}-")
        if task == "classification":
            lines = {
                name: (_column(result, "step"), _column(result, "wrong_percent"))
                for name, result in results.items()
            }
            draw.lines(out / "figure_09.png", lines, ("step", "wrong, %"), log=True)
        rows = [
            [name, _percent(best_test(r, "accuracy_percent")), str(int(r.history[-1]["step"]))]
            for name, r in results.items()
        ]
        sections.append(markdown_table((f"{task}: learning rate", "right, %", "steps"), rows))
    chosen = [
        f"Chosen for {task}: {e.architecture.kind}, {'-'.join(map(str, e.architecture.dense))}, "
        f"window {e.window}, learning rate {e.learning_rate:g}."
        for task, e in findings.chosen.items()
    ]
    return [*sections, *chosen]


def _phase_4(findings: Findings, out: Path) -> list[str]:
    rounding = findings.final_baselines["rounding"].accuracy_percent
    majority = findings.final_baselines["majority"].accuracy_percent
    accuracies = {task: e.accuracy_percent for task, e in findings.ensembles.items()}
    accuracies |= {"rounding": rounding, "majority": majority}
    labels = ("double difference", "right, %")
    draw.lines(out / "figure_10.png", _numbered(accuracies), labels, style="")
    errors = {task: e.mse_failed_cycles2 for task, e in findings.ensembles.items()}
    labels = ("double difference", "MSE of failures, cycles²")
    draw.lines(out / "figure_11.png", _numbered(errors), labels, style="")
    rows = [
        [
            task,
            _percent(float(e.accuracy_percent.mean())),
            _percent(float(e.accuracy_percent.min())),
            _percent(float(100 * (~e.failed.any(axis=1)).mean())),
            f"{int(e.reached.sum())} of {len(e.reached)}",
            str(int(e.rounds.sum())),
        ]
        for task, e in findings.ensembles.items()
    ]
    heads = ("networks", "right, mean %", "worst %", "all right, %", "good enough", "trainings")
    return [
        "## Phase 4: one network per integer (Figures 10, 11)",
        markdown_table(heads, rows),
        markdown_table(
            ("answer", "right, mean %", "all right, %"), baseline_rows(findings.final_baselines)
        ),
    ]


def _failures(findings: Findings, out: Path) -> list[str]:
    sections = ["## Do failures come together? (Figures 12-14)"]
    rng = np.random.default_rng([findings.campaign.seed, _SHUFFLES])
    joint: dict[str, Any] = {}
    for number, (task, ensemble) in zip((12, 13), findings.ensembles.items(), strict=False):
        real = run_lengths(ensemble.failed, findings.group)
        draws = findings.campaign.final.shuffles
        shuffled = shuffled_run_lengths(ensemble.failed, findings.group, draws, rng=rng)
        labels = ("consecutive failures", "how often")
        values = _numbered({task: real[1:], "shuffled": shuffled[1:]}, 1, _LEAST)
        draw.lines(out / f"figure_{number}.png", values, labels, log=True)
        joint[task] = joint_failures(ensemble.failed)[1:]
        joint[f"{task}, if independent"] = independent_joint_failures(ensemble.failed)[1:]
        chances = conditional_percent(ensemble.failed, findings.group)
        longest = int(np.flatnonzero(real).max(initial=0))
        more = " or more" if longest == LONGEST else ""
        sections.append(
            f"{task}: the longest run of failures is {longest}{more} epochs, shuffled "
            f"{np.flatnonzero(shuffled >= 0.5).max(initial=0)}; a failure follows a failure in "
            f"{_percent(chances['after_failure'])} %, a success in "
            f"{_percent(chances['after_success'])} %; most networks that failed together: "
            f"{np.flatnonzero(joint_failures(ensemble.failed)).max(initial=0)}."
        )
    labels = ("networks failing together", "epochs")
    draw.lines(out / "figure_14.png", _numbered(joint, 1, _LEAST), labels, log=True)
    return sections


def _column(result: Result, key: str) -> FloatArray:
    return np.array([entry[key] for entry in result.history])


def _numbered(
    values: Mapping[str, FloatArray | IntArray], first: int = 0, least: float = -np.inf
) -> dict[str, tuple[IntArray, FloatArray]]:
    """Return values, by name, over whole numbers; those below the least are left out."""
    return {
        name: (np.arange(first, first + len(y)), np.where(np.asarray(y) >= least, y, np.nan))
        for name, y in values.items()
    }


def _with_prefix(findings: Findings, prefix: str) -> dict[str, Result]:
    """Return results whose names begin so, by what follows."""
    of = findings.results.items()
    return {key.removeprefix(prefix): value for key, value in of if key.startswith(prefix)}


def _spread(result: Result, figure: str) -> float:
    values = np.array(result.test[figure], dtype=float)
    return float(values.max() - values.min())


def _percent(value: float) -> str:
    return f"{value:.2f}"

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import Unused
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.integer_counts import IntegerCounts
from fgnav.evaluation.report.summary import method_table, remarks, unused_lines
from fgnav.evaluation.report.text import text_lines
from fgnav.types.estimate import Rejected
from tests.evaluation.conftest import Lost, Off


def printed(comparison, width=110) -> str:
    return "\n".join(text_lines([method_table(comparison)], width))


def row(comparison, name: str) -> dict[str, str]:
    table = method_table(comparison)
    (figures,) = (figures for of, *figures in table.rows if of == name)
    return dict(zip((head.split(", ")[0] for head in table.heads[1:]), figures, strict=True))


def test_each_method_has_its_figures_in_its_row(flight):
    comparison = compare(flight, [Off("tilted", (0, 0, 0.01), position_m=0.25), Lost()])
    tilted = row(comparison, "tilted")
    assert [tilted[n] for n in ("angle", "position", "velocity")] == ["0.573", "0.250", "0.500"]
    assert tilted["epochs"] == "100.0"
    assert {value for name, value in row(comparison, "lost").items() if name != "time"} == {"–"}


def test_columns_without_a_figure_are_left_out(flight):
    comparison = compare(flight, [Off("tilted", (0, 0, 0.01))])
    assert (
        not {"position", "velocity", "NEES", "NIS", "azimuth", "fixed"}
        & row(comparison, "tilted").keys()
    )


def test_without_truth_a_row_has_medians_of_sigmas_and_a_line_names_an_open_heading(flight):
    n, more = len(Off("a").t_s), {}
    sigma_rad = np.where(np.arange(n) < 20, 1.0, 0.01)
    more["attitude_covariance_rad2"] = sigma_rad[:, None, None] ** 2 * np.eye(3)
    more["position_covariance_m2"] = np.tile(np.diag([0.04, 0.04, 0.01]), (n, 1, 1))
    comparison = compare(replace(flight, truth=None), [Off("a", position_m=0.0, more=more)])
    found = row(comparison, "a")
    assert float(found["roll"]) == pytest.approx(np.degrees(0.01), abs=0.02)
    assert (found["position"], "velocity" in found) == ("0.300", False)
    assert "a: heading is open 0.0 to 1.9 s, 1.9 s in all" in remarks(comparison)


@pytest.mark.parametrize("width", [110, 80, 60, 40])
def test_every_figure_stands_whole_at_any_width(flight, width):
    comparison = compare(flight, [Off("maximum-likelihood", (0, 0, 0.01), position_m=0.25)])
    text, whole = printed(comparison, width), printed(comparison)
    assert max(map(len, text.splitlines())) <= width
    figures = [word for word in whole.split() if "─" not in word]
    assert not [word for word in figures if text.split().count(word) < figures.count(word)]


def test_integers_are_shares_of_links_and_of_fixed_links(flight):
    comparison = compare(flight, [Off("a")])
    method = comparison["a"]
    counts = IntegerCounts(fixed=80, not_fixed=20, right=60, wrong=20)
    method = replace(method, score=replace(method.score, integers=counts))
    figures = row(replace(comparison, methods=(method,)), "a")
    assert (figures["fixed"], figures["wrong"]) == ("80.0", "25.00")


@pytest.mark.parametrize("chance", [0.002, 0.04])
def test_the_stated_chance_of_wrong_integers_stands_in_the_table_and_is_warned_of(flight, chance):
    comparison = compare(flight, [Off("a")])
    counts = IntegerCounts(fixed=80, not_fixed=20, right=60, wrong=20, chance=chance)
    method = replace(comparison["a"], score=replace(comparison["a"].score, integers=counts))
    changed = replace(comparison, methods=(method,))
    assert row(changed, "a")["chance"] == f"{100 * chance:.2f}"
    warned = [line for line in remarks(changed) if "wrong with a chance of" in line]
    assert len(warned) == (chance > 0.01)


def test_without_truth_the_table_holds_differences(flight):
    flight = replace(flight, truth=None)
    methods = [Off("closed-form", position_m=0.0), Off("maximum-likelihood", position_m=3.0)]
    text = printed(compare(flight, methods))
    assert "no truth" in text
    assert "3.000" in text
    assert "closed-form −" in text


def test_remarks_name_failures_open_angles_notes_and_missing_convergence(flight):
    more = {"unobservable": ("roll",), "notes": ("It rained.",)}
    unsure = Off("unsure", more={"converged": False})
    lines = remarks(compare(flight, [Lost(), Off("a", more=more), Off("b", more=more), unsure]))
    assert lines == [
        "lost: no solution: yaw: not in the data",
        "unsure: did not converge; its figures are not to be trusted",
        "a, b: roll is unobservable",
        "a, b: It rained.",
    ]


def test_rejected_measurements_are_told_by_kind_and_whole_in_the_figures(flight):
    links = ["a3 G05 1C"] * 3 + ["a2 G07 1C", "a4 G07 1C", "a5 G07 1C"]
    rejected = [
        Rejected(what="phase", link=link, from_s=k, until_s=k + 1.0, reason="left out")
        for k, link in enumerate(links)
    ]

    careful = Off("careful", more={"rejections": tuple(rejected)})
    comparison = compare(flight, [careful])
    told = (
        "careful: phase contradicted the rest 6 times (a3 G05 1C, a2 G07 1C, a4 G07 1C and 1 more)"
    )
    assert [line for line in remarks(comparison) if line.startswith(told)]
    listed = comparison.to_dict()["methods"]["careful"]["rejections"]
    assert len(listed) == 6
    assert listed[3] == {
        "what": "phase",
        "link": "a2 G07 1C",
        "from_s": 3,
        "until_s": 4.0,
        "reason": "left out",
    }


def test_losses_are_grouped_by_reason_with_one_example():
    unused = tuple(Unused(what=f"link {i}", reason="low", count=2) for i in range(5))
    other = Unused(what="epoch", reason="late", count=7)
    assert unused_lines({"a": unused, "b": (*unused, other)}) == [
        "lost 10 × link 0 and others: low",
        "lost 7 × epoch: late (b)",
    ]


def test_many_reasons_for_losses_are_cut_and_the_cut_is_told():
    unused = tuple(Unused(what="x", reason=f"reason {i}", count=100 - i) for i in range(11))
    lines = unused_lines({"a": unused})
    assert lines[0] == "lost 100 × x: reason 0"
    assert lines[-1] == "and 3 more reasons, all in --json"


def test_errors_against_a_reference_are_called_so_and_truth_is_truth(flight):
    text = printed(compare(flight, [Off("a")]))
    assert "RMS errors," in text
    assert "ref" not in text
    filtered = replace(flight, truth=replace(flight.truth, source="filter"))
    stated = {"attitude_covariance_rad2": np.tile(np.eye(3), (len(Off("a").t_s), 1, 1))}
    comparison = compare(filtered, [Off("a", more=stated)])
    assert "RMS errors against a reference" in printed(comparison)
    assert "NEES ref" in printed(comparison)
    (line,) = (line for line in remarks(comparison) if "estimate itself" in line)
    assert "states no sigmas" in line
    stated = replace(filtered.truth, euler_sigma_rad=np.full((len(flight.truth.t_s), 3), 0.1))
    said = remarks(compare(replace(flight, truth=stated), [Off("a")]))
    assert any("its own sigmas of attitude are counted" in line for line in said)

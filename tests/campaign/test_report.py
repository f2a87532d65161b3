"""The report of a campaign: who is the unit of an interval, and the layout of papers."""

import re

import msgspec
import numpy as np
import pytest

from fgnav.campaign.order import Order
from fgnav.campaign.report import write_report
from fgnav.evaluation.figures import FIGURES
from fgnav.evaluation.report.save import write
from tests.campaign.conftest import SMALL


def order_of(columns, cases=("ramp", "sine"), flights=12, conditions=("",)):
    values = [float(k) for k in range(columns)]
    sweep = {"name": "amplitude_deg", "values": values, "keys": {"motion.roll.amplitude_deg": True}}
    tables = [
        {"name": name, "scenario": "demo", "sweep": sweep, "condition": condition}
        for condition in conditions
        for name in cases
    ]
    return msgspec.convert({**SMALL, "flights": flights, "case": tables}, Order)


def records(order, error_deg):
    """Yield records whose errors a function of case, column, flight and method gives."""
    for number, case in enumerate(order.case):
        for column in range(case.columns):
            for flight in range(order.flights):
                methods = {}
                for title in order.titles:
                    value = error_deg(number, column, flight, title)
                    figures = dict.fromkeys(FIGURES, value) | {"available": 1.0}
                    methods[title] = {"figures": {} if value is None else figures}
                yield {"case": case.title, "column": column, "flight": flight, "methods": methods}


def lines(order, error_deg, tmp_path):
    return write_report(order, list(records(order, error_deg)), tmp_path)[0].splitlines()


def line_of(text, start):
    return next(line for line in text if line.startswith(start))


def drawn(number, column, flight, title):  # noqa: ARG001  # what columns have is the flight's own
    rng = np.random.default_rng([flight, number])
    return float(rng.uniform(1, 3)) * (0.8 if title == "quiet" else 1.0)


def test_columns_that_share_their_draws_make_no_interval_shorter(tmp_path):
    one = lines(order_of(1), drawn, tmp_path)
    nine = lines(order_of(9), drawn, tmp_path)
    assert line_of(one, "loud") == line_of(nine, "loud")
    assert re.search(r"\[\S+, \S+\]", line_of(one, "loud"))
    assert line_of(one, "quiet") == line_of(nine, "quiet")


def test_cases_of_one_sweep_stand_below_each_other_with_their_average(tmp_path):
    text = lines(order_of(3), lambda c, k, _f, t: (1 + c) * (2 + k) * (1 + (t == "loud")), tmp_path)
    top = text.index("roll, RMSE in degrees by amplitude_deg")
    rows = [line.split()[-4:] for line in text[top + 3 : top + 9]]
    assert rows[0] == ["2", "3", "4", "3"]
    assert rows[1] == ["4", "6", "8", "6"]
    assert rows[2] == ["3", "4.5", "6", "4.5"]
    assert rows[3] == ["4", "6", "8", "6"]
    assert [line.split()[-5] for line in text[top + 3 : top + 6]] == ["ramp", "sine", "average"]
    assert text[top + 1].split() == ["method", "case", "0", "1", "2", "mean"]


def test_conditions_have_tables_of_their_own(tmp_path):
    order = order_of(2, conditions=("code", "carrier"))
    text = lines(order, lambda c, *_: 1.0 + (c // 2), tmp_path)
    for condition, value in (("code", "1"), ("carrier", "2")):
        top = text.index(f"yaw, RMSE in degrees by amplitude_deg, {condition}")
        assert text[top + 5].split()[-4:] == ["average", value, value, value]
    assert "ramp, carrier" in text


def test_the_mean_over_all_has_a_ratio_with_its_interval(tmp_path):
    text = lines(order_of(3), drawn, tmp_path)
    top = text.index("mean RMSE over angles, values and cases, deg; its ratio")
    expected = np.mean([[drawn(c, 0, f, "quiet") for f in range(12)] for c in (0, 1)])
    figures = [float(x) for x in re.findall(r"[\d.]+", text[top + 4])]
    assert figures[0] == pytest.approx(expected, rel=5e-3)
    assert figures[3] == pytest.approx(0.8, rel=1e-3)
    assert text[top + 4].endswith("*")


def test_flights_without_an_answer_count_as_asked(tmp_path):
    def error_deg(_case, _column, flight, title):
        return None if title == "quiet" and flight % 4 == 0 else 1.0

    text = lines(order_of(2, cases=("ramp",)), error_deg, tmp_path)
    assert "75.0 %" in line_of(text, "quiet")
    assert line_of(text, "quiet").endswith("6 flights")
    assert "average" not in "".join(text)


def test_the_page_has_what_the_text_has(tmp_path):
    text = lines(order_of(3), drawn, tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.count("<table>") == 2 + 3 + 1  # cases, angles, all together
    assert page.count("<figure>") == 3 * 3  # angles by ramp, sine, average
    for name in ("quiet", "loud", "ramp", "sine", "average", "root seed 7"):
        assert name in page
    overall = re.search(r"0\.8 \[[^<]*", page)[0]
    assert any(overall in line for line in text)
    assert not re.search(r'd="[^"]*(nan|inf)', page)


def test_the_report_for_print_has_the_same_parts(tmp_path):
    order = order_of(3)
    _, report = write_report(order, list(records(order, drawn)), tmp_path)
    names = {path.name for path in write(report, tmp_path / "print.png")}
    assert {"print.png", "print-sweep-0.png"} <= names

"""Several flights: pooled by flight, paired by flight, and none ends the others."""

import io
import json
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass

import numpy as np
import pytest

from fgnav import cli
from fgnav.checks import BadInputError
from fgnav.evaluation.flights import FlightOutcome, FlightsComparison, compare_flights
from fgnav.evaluation.paired import paired
from fgnav.evaluation.report.flights import flights_report, innovations, on_screen, summary
from fgnav.evaluation.report.save import write
from fgnav.evaluation.report.text import text_lines
from fgnav.types.estimate import Estimate
from tests.evaluation.conftest import Off


@dataclass(frozen=True)
class Growing:
    """An estimator whose error differs from flight to flight."""

    name: str
    size_rad: float
    unfit: str = ""

    def __call__(self, flight) -> Estimate:
        number = int(flight.name)
        if flight.name == self.unfit:
            raise BadInputError("no such sensor")
        tangent = self.size_rad * (1 + 0.1 * number) * np.array([1.0, 0.0, 0.0])
        covariance = np.tile(self.size_rad**2 * np.eye(3), (100, 1, 1))
        return Off(self.name, tangent, more={"attitude_covariance_rad2": covariance})(flight)


@pytest.fixture
def flights(flight):
    from dataclasses import replace

    return [(f"f{k}", replace(flight, name=str(k))) for k in range(6)]


def run(flights, methods):
    return compare_flights(flights, methods, watch=nullcontext)


def test_figures_are_pooled_by_flight(flights):
    outcome = run(flights, [Growing("a", 0.01)])
    own = np.degrees(0.01 * (1 + 0.1 * np.arange(6)))
    rms = outcome.pooled("attitude_rmse_deg", "a")
    assert rms.value == pytest.approx(np.sqrt((own**2).mean()), rel=1e-6)
    assert rms.low < rms.value < rms.high
    assert outcome.pooled("attitude_p95_deg", "a").value == pytest.approx(own.mean(), rel=1e-6)


def test_differences_are_those_of_paired(flights):
    outcome = run(flights, [Growing("a", 0.02), Growing("b", 0.01)])
    own = outcome.paired("matched_attitude_rmse_deg", "b")
    a, b = (outcome.figure("matched_attitude_rmse_deg", name) for name in "ab")
    direct = paired(b, a, np.random.default_rng(1))
    assert own.difference.value == pytest.approx(direct.difference.value)
    assert own.ratio.value == pytest.approx(0.5, rel=1e-6)
    assert own.p_value == direct.p_value == pytest.approx(2 / 2**6)  # all six alike in sign


def test_one_flight_does_not_end_the_others(flights):
    lost = [("gone", BadInputError("gone: no such folder")), *flights]
    outcome = run(lost, [Growing("a", 0.01, unfit="2")])
    assert [one.flight for one in outcome.flights if one.failure] == ["gone", "f2"]
    assert np.isfinite(outcome.figure("attitude_rmse_deg", "a")).sum() == 5
    text = "\n".join(text_lines(on_screen(outcome), 200))
    assert "gone: not compared: gone: no such folder" in text
    assert "f2: not compared: no such sensor" in text


def test_figures_are_json_without_nan_and_the_same_twice(flights):
    methods = [Growing("a", 0.02), Growing("b", 0.01)]
    texts = [json.dumps(run(flights, methods).to_dict(), allow_nan=False) for _ in range(2)]
    content = json.loads(texts[0])
    assert content["against"] == "a"
    assert content["paired"]["b"]["matched_attitude_rmse_deg"]["flights"] == 6
    assert content["pooled"]["a"]["position_rmse_m"]["value"] is None
    assert content["flights"]["f3"]["figures"]["a"]["attitude_rmse_deg"] > 0
    without_times = [json.loads(text)["pooled"] for text in texts]
    assert without_times[0] == without_times[1]


def test_a_page_of_flights_has_every_flight(flights, tmp_path):
    outcome = run(flights, [Growing("a", 0.02), Growing("b", 0.01)])
    write(flights_report(outcome), tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text()
    for word in ("f0", "f5", "Wilcoxon p", "Against a, flight by flight", "0x5eed"):
        assert word in text
    assert "http" not in text


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    """Return a folder with three flights of two seconds."""
    place = tmp_path_factory.mktemp("batch")
    scenario = place / "short.toml"
    import fgnav_sim
    from fgnav.shipped import file_or_shipped

    text = file_or_shipped("demo", fgnav_sim.__name__, "scenarios").read_text()
    scenario.write_text(text.replace("duration_s = 60.0", "duration_s = 2.0"))
    out = place / "flights"
    command = ["simulate", str(scenario), "--seed", "1", "--batch", "3", "--out", str(out)]
    assert cli.main(command) == 0
    return out


METHODS = ["--method", "closed-form,maximum-likelihood"]


@pytest.fixture(scope="module")
def compared(batch, tmp_path_factory):
    """Return what the command prints and writes of a folder of flights."""
    folder, out = tmp_path_factory.mktemp("compared"), io.StringIO()
    files = ["--json", str(folder / "a.json"), "--report", str(folder / "a.html")]
    with redirect_stdout(out):
        assert cli.main(["compare", str(batch), *METHODS, *files]) == 0
    return out.getvalue(), json.loads((folder / "a.json").read_text()), folder / "a.html"


def test_a_folder_of_flights_is_compared_by_the_command(compared):
    text, content, report = compared
    assert "3 flights: attitude RMS errors, deg" in text
    assert "Less 'closed-form', flight by flight" in text
    assert len(content["flights"]) == 3
    ratio = content["paired"]["maximum-likelihood"]["matched_attitude_rmse_deg"]["ratio"]["value"]
    assert ratio < 0.5
    assert report.read_text().startswith("<!doctype html>")


def test_flights_by_name_are_the_same_as_their_folder(batch, compared, tmp_path):
    names = [str(batch / f"000{k}") for k in (1, 2, 3)]
    assert cli.main(["compare", *names, *METHODS, "--json", str(tmp_path / "b.json")]) == 0
    assert json.loads((tmp_path / "b.json").read_text())["pooled"] == compared[1]["pooled"]


def test_a_part_and_an_ablation_of_one_flight(batch, tmp_path):
    file = tmp_path / "a.json"
    command = ["compare", str(batch / "0001"), "--method", "maximum-likelihood,smoother"]
    options = ["--noise", "nominal", "--from", "0.5", "--until", "1.5", "--without", "doppler"]
    assert cli.main([*command, *options, "--json", str(file)]) == 0
    content = json.loads(file.read_text())
    assert content["epochs"] == 11
    assert list(content["methods"]) == [
        "maximum-likelihood",
        "smoother",
        "maximum-likelihood without doppler",
        "smoother without doppler",
    ]
    velocity = [
        content["methods"][f"smoother{w}"]["velocity_rmse_mps"] for w in ("", " without doppler")
    ]
    assert velocity[0] < velocity[1]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--without", "radar"], "without radar: not one of"),
        (["--without", "gravity"], "--without gravity: there is none without --gravity"),
        (["--without", "line-of-sight"], "without line-of-sight: flight"),
        (["--from", "9", "--until", "1"], "--from 9 --until 1: the first must be the earlier"),
        (["--from", "99"], "measured nothing then"),
    ],
)
def test_what_cannot_be_done_is_one_line(batch, options, text, capsys):
    command = ["compare", str(batch / "0001"), "--method", "rtk", *options]
    assert cli.main(command) == 2
    error = capsys.readouterr().err
    assert text in error
    assert len(error.splitlines()) == 1


def test_pictures_of_several_flights_show_every_part(flights, tmp_path):
    outcome = run(flights, [Growing("a", 0.02), Growing("b", 0.01)])
    names = {path.name for path in write(flights_report(outcome), tmp_path / "a.png")}
    assert {"a.png", "a-paired.png", "a-flights.png", "a-versions.png"} <= names


def test_a_flight_counts_once_and_one_is_needed(batch, capsys):
    one = str(batch / "0001")
    assert cli.main(["compare", one, one, *METHODS]) == 2
    assert "is named twice" in capsys.readouterr().err
    assert cli.main(["compare", *METHODS]) == 2
    assert "requires an argument" in capsys.readouterr().err


def of_details(details):
    """Return a comparison of flights whose details are given."""
    flights = tuple(
        FlightOutcome(
            flight=f"f{k}", figures={}, seconds={"a": 1.0 + k}, failures={}, detail=detail
        )
        for k, detail in enumerate(details)
    )
    return FlightsComparison(methods=("a",), flights=flights)


def detail(nis, freedom, roll_deg):
    test = {"what": "velocity", "nis": nis, "freedom": freedom}
    bound = {"crlb_deg": {"roll": roll_deg, "pitch": None, "yaw": 0.1}}
    return {"methods": {"a": {"consistency": [test]}}, "bound": bound}


def test_innovations_of_flights_are_weighed_by_their_freedom():
    outcome = of_details([detail(1.0, 300, 0.3), detail(2.0, 100, 0.4), {}])
    assert outcome.innovations("a") == {"velocity": (1.25, 400)}
    ((row,),) = (table.rows for table in innovations(outcome))
    assert row[:4] == ["a", "velocity", "400", "1.250"]
    assert row[-1] == "above"  # 95 % of 400 degrees lie within .866 and 1.143


def test_bounds_stand_below_the_methods_and_unknown_ones_do_not():
    outcome = of_details([detail(1.0, 300, 0.3), detail(1.0, 300, 0.4), {}])
    _, angles, counts = summary(outcome)
    method, bound = angles.rows
    assert method == ["a", "–", "–", "–"]
    assert bound == ["Cramér-Rao, one epoch of phase", "0.354", "–", "0.1"]  # rms of .3 and .4
    assert counts.rows == [["a", "–", "–", "–", "2"]]

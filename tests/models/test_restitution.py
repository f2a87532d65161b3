"""The restitution tables: what is flown, what is counted, and how it is laid out."""

import csv
from dataclasses import dataclass, replace

import numpy as np
import pytest

from fgnav import cli
from fgnav.checks import BadInputError
from fgnav.geometry import rotations
from fgnav.types.estimate import Estimate
from fgnav_models import restitution
from fgnav_models.restitution import (
    AMPLITUDES_DEG,
    BY_RIGHT_INTEGERS,
    READINGS,
    Case,
    Run,
    cases,
    flight_of,
    restitute,
)
from fgnav_models.restitution_report import FIGURE, summary_lines, summed_up, write_report

PRECISE = Case(reading=READINGS[0], motion="sine", amplitude_deg=20, seed=1)
BY_CODE = replace(PRECISE, reading=READINGS[-1])
FILES = ("tables.txt", "tables.csv", "runs.csv", FIGURE)


@pytest.fixture(scope="module")
def runs():
    """Return what all methods make of a flight with precise range, and of one with code."""
    return restitute([PRECISE, BY_CODE], processes=1)


def of(runs, case, method):
    (run,) = [run for run in runs if (run.case, run.method) == (case, method)]
    return run


def test_every_reading_motion_and_amplitude_is_flown_with_every_seed():
    assert AMPLITUDES_DEG == (5, 10, 15, 20, 25, 30, 35, 40, 45)
    assert len(set(cases(3))) == len(READINGS) * 2 * 9 * 3
    assert {case.seed for case in cases(3)} == {1, 2, 3}
    with pytest.raises(BadInputError, match="--seeds: must be 1 or more, got 0"):
        cases(0)


def test_ramp_rises_evenly_to_its_amplitude_in_ten_seconds():
    truth = flight_of(replace(PRECISE, motion="ramp", amplitude_deg=35)).truth
    angles_deg = np.degrees(rotations.to_euler(truth.R_nb))
    np.testing.assert_allclose(angles_deg, 3.5 * truth.t_s[:, None] + np.zeros(3), atol=1e-9)
    assert truth.t_s[-1] == pytest.approx(9.9)


def test_sine_swings_all_angles_at_one_radian_per_second():
    truth = flight_of(PRECISE).truth
    angles_deg = np.degrees(rotations.to_euler(truth.R_nb))
    expected = 20 * np.sin(truth.t_s)[:, None] + np.zeros(3)
    np.testing.assert_allclose(angles_deg, expected, atol=1e-9)


def test_seeds_fly_at_other_hours_and_readings_share_the_sky():
    precise, by_code = flight_of(PRECISE), flight_of(BY_CODE)
    assert precise.start_gps_s == by_code.start_gps_s
    assert precise.observations.satellites == by_code.observations.satellites
    assert len(precise.observations.satellites) == 6
    assert flight_of(replace(PRECISE, seed=2)).start_gps_s != precise.start_gps_s


def test_smoother_is_within_a_quarter_of_the_papers_method_at_its_best(runs):
    for case in (PRECISE, BY_CODE):
        best = np.mean(of(runs, case, BY_RIGHT_INTEGERS).rmse_deg)
        smoother = np.mean(of(runs, case, "smoother, constrained").rmse_deg)
        assert 0 < smoother < 0.25 * best


def test_networks_leave_alone_where_the_range_is_code(runs):
    """Trained on noise of millimetres; where they answered more than half was wrong."""
    precise = of(runs, PRECISE, "closed form, classification")
    assert precise.wrong < 0.03
    assert precise.clean_deg < 0.5  # what has only right integers is as good as the phase allows
    by_code = of(runs, BY_CODE, "closed form, classification")
    assert by_code.available == 0.0
    assert by_code.failure
    assert of(runs, BY_CODE, BY_RIGHT_INTEGERS).wrong == 0.0


def test_method_without_an_answer_is_counted_with_its_reason(runs):
    run = of(runs, BY_CODE, "smoother, classification")
    assert run.available == 0.0
    assert np.isnan(run.rmse_deg).all()
    assert "consistent array phases" in run.failure
    (failed,) = [line for line in summary_lines(summed_up(runs)) if run.failure in line]
    assert "no answer in 1 flights" in failed


@dataclass(frozen=True)
class Level:
    """Says that every flight is level, and nothing of integers."""

    name: str = "level"

    def __call__(self, flight):
        t_s = flight.truth.t_s
        R_nb = np.tile(np.eye(3), (len(t_s), 1, 1))
        return Estimate(method=self.name, t_s=t_s, epochs=len(t_s), R_nb=R_nb)


def test_estimate_without_integers_is_not_judged(monkeypatch):
    monkeypatch.setattr(restitution, "estimators", lambda: ((Level(), True),))
    (run,) = restitute([PRECISE], processes=1)
    assert run.failure == "no truth, or no integers, to judge by"


@pytest.mark.timeout(300)  # new processes load and compile everything anew
def test_runs_and_bytes_do_not_depend_on_processes(runs, tmp_path):
    here = [run for run in runs if run.case == PRECISE]
    apart = restitute([PRECISE], processes=2)
    for name, some in (("one", here), ("two", apart)):
        (tmp_path / name).mkdir()
        write_report(some, tmp_path / name)
    for file in FILES:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()
    with pytest.raises(BadInputError, match="--processes: must be 1 or more, got 0"):
        restitute([PRECISE], processes=0)


def made_up():
    """Return runs of two seeds whose RMS in roll are 3 and 4 times the amplitude over 5."""
    return [
        Run(
            case=case,
            method=BY_RIGHT_INTEGERS,
            rmse_deg=(
                (2 + case.seed) * case.amplitude_deg / 5 * (1 + (case.motion == "sine")),
                1,
                2,
            ),
            available=case.seed / 2,
        )
        for case in cases(2)
    ]


def test_seeds_are_joined_by_squares_and_amplitudes_by_the_mean():
    figures = summed_up(made_up())
    ramp = np.sqrt(12.5) * np.arange(1, 10)
    expected = np.array([ramp, 2 * ramp, 1.5 * ramp])
    table_deg = figures.table_deg(0, 0, 0)
    np.testing.assert_allclose(table_deg[:, :-1], expected)
    np.testing.assert_allclose(table_deg[:, -1], expected.mean(axis=1))
    roll = 1.5 * 5 * np.sqrt(12.5)
    np.testing.assert_allclose(figures.overall_deg(2), [[roll, 1, 2, (roll + 3) / 3]])
    assert figures.shares[0, 0, 0] == 0.75


def test_average_over_flights_without_an_answer_is_none():
    lost = [
        replace(run, rmse_deg=(np.nan,) * 3) if run.case.amplitude_deg == 5 else run
        for run in made_up()
    ]
    figures = summed_up(lost)
    assert np.isnan(figures.table_deg(0, 0, 0)[:, [0, -1]]).all()
    assert np.isfinite(figures.table_deg(0, 0, 0)[:, 1:-1]).all()
    assert "–" in summary_lines(figures)[4]


def test_tables_have_the_papers_layout(tmp_path):
    write_report(made_up(), tmp_path)
    text = (tmp_path / "tables.txt").read_text(encoding="utf-8")
    for title in ("Table 5. RMSE of roll", "Table 6. RMSE of pitch", "Table 7. RMSE of yaw"):
        assert text.count(title) == len(READINGS)
    with (tmp_path / "tables.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["motion"] for row in rows[:3]] == ["ramp", "sine", "average"]
    assert list(rows[0])[4:] == [*(f"{a}_deg" for a in AMPLITUDES_DEG), "average"]
    assert float(rows[0]["10_deg"]) == pytest.approx(2 * np.sqrt(12.5), rel=1e-5)
    assert len(rows) == len(READINGS) * 3 * 3
    assert (tmp_path / FIGURE).read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FILES)


def test_command_writes_all_files_and_prints_the_summary(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(
        restitution, "judged", lambda case: [r for r in made_up() if r.case == case]
    )
    out = tmp_path / "tables"
    arguments = ["restitution", "--out", str(out), "--seeds", "2", "--processes", "1"]
    assert cli.main(arguments) == 0
    printed = capsys.readouterr().out
    assert f"tables and figure are in {out}" in printed
    assert BY_RIGHT_INTEGERS in printed
    assert {path.name for path in out.iterdir()} == set(FILES)
    assert cli.main(["restitution", "--out", str(out), "--seeds", "0"]) == 2
    assert "--seeds: must be 1 or more" in capsys.readouterr().err

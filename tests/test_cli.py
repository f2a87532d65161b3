import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from html import unescape
from importlib.metadata import EntryPoint
from pathlib import Path

import msgspec
import numpy as np
import pytest

from fgnav import cli, diagnostics
from fgnav.checks import BadInputError, NoSolutionError
from fgnav.cli import program
from fgnav.diagnostics.contents import Finding
from fgnav.io.exports.recorded import load_estimate
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.types.estimate import Estimate, Verdict
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a flight folder of two seconds."""
    demo = load_scenario(ROOT / "sim" / "fgnav_sim" / "scenarios" / "demo.toml")
    flight = simulate(msgspec.structs.replace(demo, duration_s=2.0), np.random.default_rng(1))
    place = tmp_path_factory.mktemp("cli") / "flight"
    save_flight(flight, place)
    return place


@dataclass(frozen=True)
class Level:
    """Says that the flight is level and northbound, or fails as told."""

    name: str = "level"
    error: Exception | None = None
    converged: bool = True
    verdicts: tuple[Verdict, ...] = ()

    def __call__(self, flight):
        if self.error is not None:
            raise self.error
        t_s = flight.truth.t_s
        return Estimate(
            method=self.name,
            t_s=t_s,
            n_epochs=len(t_s),
            R_nb=np.tile(np.eye(3), (len(t_s), 1, 1)),
            converged=self.converged,
            verdicts=self.verdicts,
            unobservable=("roll",),
        )


@pytest.fixture
def methods(monkeypatch):
    """Return a function that says which estimators every command shall get."""

    def use(*estimators):
        for command in ("run", "compare"):
            named = f"fgnav.cli.{command}.estimators_named"
            monkeypatch.setattr(named, lambda *_names: list(estimators))

    return use


def test_help_names_all_commands_and_an_example(capsys):
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out
    for word in ("check", "run", "compare", "simulate", "fgnav simulate demo"):
        assert word in text


@pytest.mark.parametrize("command", program.commands())
def test_help_of_a_command_shows_no_empty_default_and_no_option_that_undoes_another(
    command, capsys
):
    assert cli.main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"fgnav {command}" in out
    assert re.search(r"default: (\"\"|None|False|)\]", out) is None
    assert re.search(r"--(no|empty)-", out) is None


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from fgnav.cli import main; main(['--help']);"
        "heavy = {'cyclopts', 'rich', 'numpy', 'scipy', 'numba', 'gtsam', 'matplotlib', 'msgspec',"
        "'fgnav_sim', 'fgnav_models'};"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_version_is_the_library_s(capsys):
    from fgnav import __version__

    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == __version__


def test_check_tells_what_is_there(folder, capsys):
    assert cli.main(["check", str(folder)]) == 0
    text = capsys.readouterr().out
    assert "antennas  8: a1 a2 a3 a4 a5 a6 a7 a8" in text
    assert "× GPS 1C" in text
    assert "20 samples, 10 Hz, 0.000 to 1.900 s" in text
    assert "no findings" in text


def test_check_as_json_is_all_there_is_on_standard_output(folder, capsys):
    assert cli.main(["check", str(folder), "--json", "-"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["series"]["imu"]["samples"] == 200
    assert content["findings"] == []


def test_compare_prints_writes_json_and_draws(folder, tmp_path, capsys):
    figures, report = tmp_path / "figures.json", tmp_path / "report.png"
    command = ["compare", str(folder), "--method", "closed-form,maximum-likelihood,rtk"]
    assert cli.main([*command, "--json", str(figures), "--report", str(report)]) == 0
    streams = capsys.readouterr()
    assert "maximum-likelihood" in streams.out
    assert "bound of one epoch" in streams.out
    assert streams.err == ""  # no progress on a pipe
    content = json.loads(figures.read_text())
    assert list(content["methods"]) == ["closed-form", "maximum-likelihood", "rtk"]
    assert content["epochs"] == 20
    assert content["methods"]["maximum-likelihood"]["integers"]["wrong"] == 0
    ratio = content["methods"]["maximum-likelihood"]["attitude_rmse_deg"] / np.linalg.norm(
        list(content["bound"]["crlb_deg"].values())
    )
    assert 0.5 < ratio < 1.5  # twenty epochs
    assert report.read_bytes().startswith(b"\x89PNG")
    assert "more, by parts: report-errors.png" in streams.out
    parts = {path.stem.split("-")[1] for path in tmp_path.glob("report-*.png")}
    assert {"errors", "motion", "sky", "integers", "consistency", "versions"} <= parts


def test_compare_with_json_on_standard_output_prints_nothing_else(folder, methods, capsys):
    methods(Level())
    assert cli.main(["compare", str(folder), "--json", "-"]) == 0
    assert list(json.loads(capsys.readouterr().out)["methods"]) == ["level"]


def test_compare_goes_on_when_one_method_fails(folder, methods, capsys):
    methods(Level(), Level(name="lost", error=NoSolutionError("yaw: unobservable")))
    assert cli.main(["compare", str(folder)]) == 0
    assert "lost: no solution: yaw: unobservable" in capsys.readouterr().out


def test_compare_keeps_the_estimate_of_each_method_that_has_one(folder, methods, tmp_path, capsys):
    methods(Level(), Level(name="lost", error=NoSolutionError("yaw: unobservable")))
    assert cli.main(["compare", str(folder), "--out", str(tmp_path / "all")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert f"level: 20 of 20 epochs in {tmp_path / 'all' / 'level' / 'estimate.csv'}" in lines
    assert "lost: yaw: unobservable" in lines
    assert [path.name for path in (tmp_path / "all").iterdir()] == ["level"]
    summary = json.loads((tmp_path / "all" / "level" / "summary.json").read_text())
    assert list(summary["methods"]) == ["level"]
    assert load_estimate(tmp_path / "all" / "level").estimate.converged


def test_compare_keeps_estimates_of_one_flight_only(folder, methods, tmp_path, capsys):
    methods(Level())
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    assert cli.main(["compare", str(folder), str(other), "--out", str(tmp_path / "all")]) == 2
    assert "keeps estimates of one flight, not of 2" in capsys.readouterr().err
    assert not (tmp_path / "all").exists()


def test_compare_where_every_method_fails_exits_with_one(folder, methods, capsys):
    methods(Level(name="lost", error=NoSolutionError("yaw: unobservable")))
    assert cli.main(["compare", str(folder)]) == 1
    want = "fgnav: no method has a solution: lost: yaw: unobservable\n"
    assert capsys.readouterr().err == want


def test_run_writes_the_estimate_and_its_figures(folder, methods, tmp_path, capsys):
    methods(Level())
    out = tmp_path / "new" / "results"
    assert cli.main(["run", str(folder), "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == [
        "estimate.csv",
        "estimate.npz",
        "summary.json",
    ]
    assert len((out / "estimate.csv").read_text().splitlines()) == 21
    assert json.loads((out / "summary.json").read_text())["methods"]["level"]["available"] == 1.0
    assert "level: 20 of 20 epochs" in capsys.readouterr().out


VERDICTS = (
    Verdict(sensor="velocity", from_s=0.5, until_s=1.5, ratio=9.0, limit=4.0, test="1 s"),
    Verdict(sensor="velocity", from_s=1.7, until_s=1.9, ratio=5.0, limit=4.0, test="1 s"),
)


@pytest.mark.parametrize("command", ["run", "compare"])
def test_measurements_that_contradict_each_other_are_an_error_with_strict_alone(
    command, folder, methods, tmp_path, capsys
):
    methods(Level(verdicts=VERDICTS))
    for strict, status in (([], 0), (["--strict"], 1)):
        out = tmp_path / str(status)
        assert cli.main([command, str(folder), "--out", str(out), *strict]) == status
        streams = capsys.readouterr()
        (line,) = (line for line in streams.out.splitlines() if "inconsistent" in line)
        assert f"inconsistent: {VERDICTS[0]}" in line
        assert len(list(out.rglob("estimate.csv"))) == 1  # of an inconsistent flight as well
        error = "fgnav: --strict: measurements contradict each other: level: velocity\n"
        assert streams.err == (error if strict else "")


@pytest.mark.parametrize("command", ["run", "compare"])
def test_a_consistent_flight_is_no_error_with_strict(command, folder, methods, tmp_path, capsys):
    methods(Level())
    assert cli.main([command, str(folder), "--out", str(tmp_path / "out"), "--strict"]) == 0
    assert "inconsistent" not in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "Unable to allocate 46 GiB"])
def test_too_little_memory_is_one_line(folder, methods, capsys, text):
    methods(Level(error=MemoryError(text)))
    assert cli.main(["compare", str(folder)]) == 2
    want = f"fgnav: not enough memory for this flight: {text or 'nothing is left'}\n"
    assert capsys.readouterr().err == want


@pytest.mark.parametrize("name", ["flight.toml", "imu.csv", "a1.rnx", "truth.csv"])
def test_figures_never_replace_a_file_of_the_flight(folder, methods, tmp_path, capsys, name):
    methods(Level())
    before = (folder / name).read_bytes()
    link = tmp_path / "link"
    link.symlink_to(folder / name)
    for place in (folder / name, link):
        for command in ("check", "compare"):
            assert cli.main([command, str(folder), "--json", str(place)]) == 2
            assert "is a file of the flight itself; name another" in capsys.readouterr().err
    assert (folder / name).read_bytes() == before


def test_estimates_of_a_comparison_never_replace_a_file_of_the_flight(
    folder, methods, tmp_path, capsys
):
    own = tmp_path / "level"  # as the method is named
    shutil.copytree(folder, own)
    samples = (own / "imu.csv").rename(own / "estimate.csv")
    text = (own / "flight.toml").read_text()
    (own / "flight.toml").write_text(text.replace("imu.csv", samples.name))
    before = samples.read_bytes()
    methods(Level())
    assert cli.main(["compare", str(own), "--out", str(tmp_path)]) == 2
    assert "estimate.csv" in capsys.readouterr().err
    assert samples.read_bytes() == before


def test_an_estimate_never_replaces_a_file_of_the_flight(folder, methods, tmp_path, capsys):
    methods(Level())
    mine = shutil.copytree(folder, tmp_path / "mine")
    toml = (mine / "flight.toml").read_text()
    (mine / "flight.toml").write_text(toml.replace("truth.csv", "estimate.csv"))
    (mine / "truth.csv").rename(mine / "estimate.csv")
    assert cli.main(["run", str(mine), "--out", str(mine)]) == 2
    assert "estimate.csv: is a file of the flight itself" in capsys.readouterr().err


def test_more_times_than_memory_holds_are_refused(folder, tmp_path, capsys):
    out = str(tmp_path / "out")
    assert cli.main(["run", str(folder), "--out", out, "--rate", "1e9"]) == 2
    assert "at most 50000 are estimated at once" in capsys.readouterr().err
    times = tmp_path / "times.csv"
    times.write_text("t_s\n" + "".join(f"{k * 1e-5:.5f}\n" for k in range(60_000)))
    assert cli.main(["run", str(folder), "--out", out, "--at", str(times)]) == 2
    assert "times.csv: has 60000 times, at most 50000" in capsys.readouterr().err


def test_run_writes_what_was_estimated_with_the_flight(folder, tmp_path, capsys):
    command = ["run", str(folder), "--method", "batch", "--calibrate", "lever-arm, antenna:a4=0.02"]
    assert cli.main([*command, "--out", str(tmp_path / "out")]) == 0
    told = json.loads((tmp_path / "out" / "summary.json").read_text())["methods"]["batch"]
    names = [one["name"] for one in told["calibration"]]
    assert names == ["lever-arm", "antenna a4"]
    assert all(0 < sigma < 0.02 for sigma in told["calibration"][1]["sigma"].values())
    assert "Antenna a4, difference from the nominal: x_b" in capsys.readouterr().out


def test_a_lag_is_the_window_s(folder, tmp_path):
    command = ["run", str(folder), "--integers", "truth"]
    for lag in ("0.1", "5"):
        assert cli.main([*command, "--lag", lag, "--out", str(tmp_path / lag)]) == 0
    assert cli.main([*command, "--out", str(tmp_path / "usual")]) == 0
    short, long, usual = (
        (tmp_path / name / "estimate.csv").read_bytes() for name in ("0.1", "5", "usual")
    )
    assert short != long == usual


def test_run_at_a_rate_writes_as_many_rows(folder, tmp_path, capsys):
    out = tmp_path / "results"
    command = ["run", str(folder), "--method", "batch", "--integers", "truth", "--out", str(out)]
    assert cli.main([*command, "--rate", "50"]) == 0
    assert len((out / "estimate.csv").read_text().splitlines()) == 97
    assert "batch: 96 of 96 epochs" in capsys.readouterr().out


@pytest.mark.parametrize("command", [["run", "--out", "out"], ["compare"]])
def test_a_report_is_a_page_of_the_flight(folder, methods, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    methods(Level())
    name, *options = command
    assert cli.main([name, str(folder), *options, "--report", "new/report.html"]) == 0
    text = (tmp_path / "new" / "report.html").read_text()
    assert 'format = "fgnav-flight/1"' in unescape(text)
    assert ">level</th>" in text


def test_run_without_solution_writes_nothing_and_exits_with_one(folder, methods, tmp_path, capsys):
    methods(Level(error=NoSolutionError("yaw: unobservable")))
    assert cli.main(["run", str(folder), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err == "fgnav: level: yaw: unobservable\n"
    assert not (tmp_path / "out").exists()


def test_run_takes_one_method(folder, tmp_path, capsys):
    command = ["run", str(folder), "--method", "rtk,closed-form", "--out", str(tmp_path / "out")]
    assert cli.main(command) == 2
    assert "--method rtk,closed-form: run takes one method" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "text"),
    [
        (["check", "nowhere"], "nowhere"),
        (["compare", "nowhere", "--method", "magic"], "method 'magic': not one of closed-form"),
        (["compare", "nowhere", "--method", "smother"], "did you mean smoother?"),
        (["compare", "nowhere", "--metod", "rtk"], "Did you mean --method?"),
        (["compare", "nowhere", "--integers", "magic"], "magic"),
        (["compare", "nowhere", "--method", ","], "--method: names no method"),
        (["compare", "nowhere", "--calibrate", "landmrk"], "'landmrk' is none of landmark"),
        (
            ["run", "nowhere", "--out", "o", "--method", "rtk", "--calibrate", "landmark"],
            "only smo",
        ),
        (
            ["run", "nowhere", "--out", "o", "--method", "rtk", "--rate", "9"],
            "its own epochs alone",
        ),
        (["compare", "nowhere", "--method", "batch,rtk", "--lag", "2"], "--lag: only smoother"),
        (["compare", "nowhere", "--lag", "0"], "smoother lag_s: must be"),
        (["compare", "nowhere", "--report", "report.bmp"], "end its name in .html, .png or .pdf"),
        (["compare", "nowhere", "--json", "absent/a.json"], "its folder does not exist"),
        (["check"], "requires an argument"),
        (["check", "nowhere", "--json", "--speed"], "wants a file or -, got '--speed'"),
        (["compare", "nowhere", "--speed", "9"], "--speed"),
        (["fly"], "fly"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_two(command, text, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(command) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert streams.err.startswith("fgnav: ")
    assert len(streams.err.splitlines()) == 1
    assert text in streams.err
    assert list(tmp_path.iterdir()) == []


def test_remarks_are_as_many_as_asked_for(folder, methods, tmp_path, capsys):
    methods(Level())
    command = ["compare", str(folder), "--until", "0.5", "--log", str(tmp_path / "log")]
    said = {}
    for option in ("--quiet", "", "--verbose"):
        assert cli.main([*command, *filter(None, [option])]) == 0
        said[option] = capsys.readouterr().err
    assert said["--quiet"] == ""
    assert f"reading {folder}: " in said["--verbose"]
    assert "reading" not in said[""]
    log = (tmp_path / "log").read_text()
    assert log.count("INFO fgnav compare") == 2  # quiet is the log, too
    assert cli.main(["check", "nowhere", "--log", str(tmp_path / "log"), "--quiet"]) == 2
    assert "ERROR fgnav: " in (tmp_path / "log").read_text()
    assert cli.main(["check", "nowhere", "--log"]) == 2
    assert capsys.readouterr().err.endswith("fgnav: --log: expected one argument\n")


def test_an_estimate_is_replaced_whole_or_not_at_all(
    folder, methods, tmp_path, capsys, monkeypatch
):
    from fgnav.io.exports import tables

    methods(Level())
    command = ["run", str(folder), "--out", str(tmp_path / "out")]
    assert cli.main(command) == 0
    before = {path: path.stat().st_ino for path in (tmp_path / "out").iterdir()}
    assert "earlier" not in capsys.readouterr().out

    def full(*_arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(tables, "write_outcome", full)
        assert cli.main(command) == 2
    assert {path: path.stat().st_ino for path in (tmp_path / "out").iterdir()} == before
    capsys.readouterr()
    assert cli.main(command) == 0
    assert "estimate.csv, for an earlier one" in capsys.readouterr().out


def test_findings_are_an_error_of_check_with_strict_alone(folder, monkeypatch, capsys):
    assert cli.main(["check", str(folder), "--strict"]) == 0
    found = replace(diagnostics.describe(load_flight(folder)), findings=(Finding("imu", "late"),))
    monkeypatch.setattr(diagnostics, "describe", lambda _flight: found)
    assert cli.main(["check", str(folder)]) == 0
    assert cli.main(["check", str(folder), "--strict"]) == 1
    assert capsys.readouterr().err == "fgnav: --strict: the set-up has mistakes: imu\n"


def test_a_program_without_a_home_directory_finds_its_way(tmp_path):
    code = (
        "import os, pwd; os.environ.pop('HOME', None)\n"
        "def nobody(uid): raise KeyError(uid)\n"
        "pwd.getpwuid = nobody\n"
        "from fgnav.cli import main; main(['methods'])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (BadInputError("imu.csv: line 3: a column\ntoo few"), 2),
        (OSError("disk full"), 2),
        (KeyboardInterrupt(), 130),
    ],
)
def test_errors_on_the_way_have_their_status_and_no_traceback(
    folder, methods, error, status, capsys
):
    methods(Level(error=error))
    assert cli.main(["compare", str(folder)]) == status
    assert len(capsys.readouterr().err.splitlines()) <= 1


def test_a_reader_that_goes_away_is_no_traceback():
    read, write = os.pipe()
    os.close(read)
    command = [
        sys.executable,
        "-c",
        "import sys; from fgnav.cli import main; sys.exit(main())",
        "-h",
    ]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (1, "")


def test_a_run_that_did_not_converge_writes_nothing(folder, methods, tmp_path, capsys):
    methods(Level(converged=False))
    assert cli.main(["run", str(folder), "--out", str(tmp_path / "out")]) == 1
    text = "level: did not end at a minimum, nothing is written; the data leave open: roll"
    assert text in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_installed_commands_are_found_by_entry_point(monkeypatch, capsys):
    entry = EntryPoint(name="greet", value="no_such_module:greet", group="fgnav.commands")
    monkeypatch.setattr(program, "entry_points", lambda **_: [entry])
    assert cli.main(["--help"]) == 0  # listed without being imported
    assert "greet" in capsys.readouterr().out

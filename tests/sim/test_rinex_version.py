"""The RINEX version that a scenario asks for is the one that is written."""

import pytest

from fgnav.cli import main
from fgnav.io.flight.folder import load_flight

SCENARIO = """\
duration_s = 1.0
antennas_b_m = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
[gnss]
rate_hz = 2.0
"""


@pytest.mark.parametrize(("key", "version"), [("", "3.04"), ('rinex = "4.00"', "4.00")])
def test_observations_and_messages_are_of_the_version_asked_for(tmp_path, key, version):
    (tmp_path / "s.toml").write_text(SCENARIO + key)
    out = tmp_path / "flight"
    assert main(["simulate", str(tmp_path / "s.toml"), "--seed", "1", "--out", str(out)]) == 0
    for name in ("a1.rnx", "a2.rnx", "broadcast.rnx"):
        assert (out / name).read_text().startswith(f"     {version}")
    assert load_flight(out).observations.tracked.all()


def test_a_version_that_is_not_written_is_refused(tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SCENARIO + 'rinex = "2.11"')
    out = tmp_path / "flight"
    assert main(["simulate", str(tmp_path / "s.toml"), "--seed", "1", "--out", str(out)]) == 2
    assert "gnss.rinex: must be" in capsys.readouterr().err
    assert not out.exists()

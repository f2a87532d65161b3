import numpy as np
import pytest

from fgnav.io.importers.recognise import recognise_format
from tests.io.importers.helpers import imported, refused

STEP_S, RATE, FORCE = 0.005, [0.1, -0.2, 0.3], [0.5, -1.0, -9.8]


@pytest.fixture
def files(tmp_path):
    """A unit at constant rate and force, two fixes and a reference, as KF-GINS writes them."""
    t = 456300 + STEP_S * np.arange(1, 401)
    increments = np.tile(np.array(RATE + FORCE) * STEP_S, (400, 1))
    np.savetxt(tmp_path / "imu.txt", np.column_stack([t, increments]), fmt="%.12f")
    fixes = [[456300, 30.4, 114.4, 22, 0.01, 0.02, 0.03], [456301, 30.4, 114.4, 23, 0.1, 0.1, 0.1]]
    np.savetxt(tmp_path / "gnss.txt", fixes, fmt="%.12f")
    reference = [[2017, 456300 + k, 30.4, 114.4, 22, 1, 2, 3, 4, 5, 6] for k in range(2)]
    np.savetxt(tmp_path / "truth.nav", reference, fmt="%.9f")
    return [tmp_path / name for name in ("imu.txt", "gnss.txt", "truth.nav")]


def test_increments_become_rates_at_the_middle_of_their_interval(tmp_path, files):
    _, flight = imported(tmp_path, "kfgins", *files)
    assert flight.start_gps_s == 2017 * 604800 + 456300
    np.testing.assert_allclose(flight.imu.t_s[:2], [STEP_S / 2, 1.5 * STEP_S], atol=1e-7)
    np.testing.assert_allclose(flight.imu.w_b_radps, np.tile(RATE, (400, 1)), rtol=1e-6)
    np.testing.assert_allclose(flight.imu.f_b_mps2, np.tile(FORCE, (400, 1)), rtol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m[0], [0.01, 0.02, 0.03])
    np.testing.assert_allclose(flight.fixes[0].p_n_m[1], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(flight.truth.v_n_mps[0], [1, 2, 3], atol=1e-9)


def test_its_files_are_told_by_their_content(tmp_path, files):
    for path in files:
        assert recognise_format(path, tmp_path) == ("kfgins", path)
    rates = [f"{456300 + 0.01 * k:.2f} 0.01 0.02 0.03 0.1 0.2 -9.8" for k in range(5)]
    (tmp_path / "rates.csv").write_text("\n".join(rates) + "\n")  # no increments
    assert recognise_format(tmp_path / "rates.csv", tmp_path)[0] == "csv"


def test_a_gap_of_the_unit_does_not_thin_its_rates(tmp_path, files):
    lines = files[0].read_text().splitlines()
    files[0].write_text("\n".join(lines[:100] + lines[200:]) + "\n")
    _, flight = imported(tmp_path, "kfgins", *files)
    np.testing.assert_allclose(flight.imu.w_b_radps, np.tile(RATE, (300, 1)), rtol=1e-6)


def test_what_is_damaged_is_counted_and_what_is_none_is_refused(tmp_path, files, capsys):
    lines = files[0].read_text().splitlines()
    lines[5], lines[7] = lines[5][:30], lines[7].replace(".", "x")
    files[0].write_text("\n".join(lines) + "\n")
    whole, flight = imported(tmp_path, "kfgins", *files)
    assert len(flight.imu.t_s) == 398
    reasons = {one.reason.partition(":")[0]: one.count for one in whole.unused}
    assert reasons == {"has another number of columns": 1, "a cell is no number": 1}
    for text, count in (("1 2 3\n1 2 3\n", "2 of 3"), ("", "0 of 0")):
        (tmp_path / "a.txt").write_text(text)
        line = refused(capsys, tmp_path, tmp_path / "a.txt", "--format", "kfgins")
        assert "must have two rows of numbers or more, of 7 columns (inc" in line
        assert f"has {count}" in line

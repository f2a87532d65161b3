import json

import numpy as np
import pytest
from scipy.io import savemat

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.io.importers import importer_named, importer_names
from fgnav.io.importers.assemble import assemble
from fgnav.io.importers.formats.umn import read_umn as read_recording
from fgnav.io.importers.settings import Settings
from tests.io.importers.helpers import AROUND, imported


def read_umn(path):
    settings = Settings()
    return assemble([read_recording(path, settings, path.parent)], settings).flight


@pytest.fixture(scope="module")
def thor(shared):
    return shared / "flights" / "thor75" / "thor_flight75.mat"


def made(**changes):
    """A recording of two seconds: still, level, one fix a second."""
    n = 100
    t = 0.02 * np.arange(1, n + 1)
    zero = np.zeros(n)
    data = dict.fromkeys(("p", "q", "r", "ax", "ay", "vn", "ve", "vd"), zero)
    data |= dict.fromkeys(("navvn", "navve", "navvd", "phi", "theta", "psi", "navValid"), zero)
    data |= {"time": t, "az": zero - 9.8, "imuStatus": zero + 3, "GPS_TOW": np.floor(t) + 5}
    data |= {"lat": zero + 45, "lon": zero - 93, "alt": zero + 250}
    data |= {"navlat": np.radians(data["lat"]), "navlon": np.radians(data["lon"])}
    data["navalt"] = data["alt"]
    return {"flight_data": {k: v for k, v in (data | changes).items() if v is not None}}


def written(tmp_path, content):
    savemat(tmp_path / "flight.mat", content)
    return tmp_path / "flight.mat"


def test_a_made_recording_is_read_as_it_is(tmp_path):
    flight = read_umn(written(tmp_path, made()))
    assert len(flight.imu.t_s) == 100
    np.testing.assert_allclose(flight.fixes.t_s, [0, 0.98, 1.98], atol=1e-9)
    np.testing.assert_allclose(flight.truth.p_n_m, 0, atol=1e-6)
    np.testing.assert_allclose(flight.imu.f_b_mps2[0], [0, 0, -9.8])


def test_barometer_and_magnetometer_come_with_their_stated_noise(tmp_path):
    around = {"h": np.full(100, 12.5), "hx": np.full(100, 0.25)}
    around |= {"hy": np.full(100, 0.125), "hz": np.full(100, -0.5)}
    file = written(tmp_path, made(**around))
    _, flight = imported(tmp_path, "umn", file, toml=AROUND)
    np.testing.assert_allclose(flight.barometer.height_m, 12.5)
    np.testing.assert_allclose(flight.magnetometer.field_b_ut[0], [25, -12.5, 50])


def test_axes_and_unit_of_a_real_field_are_those_of_the_earth_s(thor, tmp_path):
    """The field in body axes is the Earth's, 18 and 51 microtesla there, and a large hard iron."""
    _, flight = imported(tmp_path, "umn", thor, toml=AROUND)
    magnet, truth = flight.magnetometer, flight.truth
    rows = np.searchsorted(truth.t_s, magnet.t_s).clip(0, len(truth.t_s) - 1)
    earth_b_ut = np.einsum("nji,j->ni", truth.R_nb[rows], [18.0, 0.0, 51.0])
    flown = np.linalg.norm(truth.v_n_mps[rows], axis=1) > 10
    design = np.column_stack([earth_b_ut, np.ones(len(rows))])[flown]
    gains = np.linalg.lstsq(design, magnet.field_b_ut[flown])[0][:3]
    np.testing.assert_allclose(gains, np.eye(3), atol=0.07)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ({"other": 1}, "flight.mat: has no structure flight_data"),
        (made(az=None), "flight.mat: flight_data.az: missing"),
        (made(q=np.zeros(7)), r"flight_data.q: \(7,\), must be \(100,\)"),
        (made(q=np.full(100, np.nan)), "flight_data.q: row 0 is not finite"),
        (made(GPS_TOW=np.zeros(100)), "needs two GPS fixes and a filter solution"),
    ],
)
def test_what_is_no_recording_is_named(tmp_path, content, text):
    with pytest.raises(BadInputError, match=text):
        read_umn(written(tmp_path, content))


def test_files_that_are_not_matlab_are_named(tmp_path):
    (tmp_path / "text.mat").write_text("no matlab")
    with pytest.raises(BadInputError, match=r"text\.mat: must be a MATLAB file"):
        read_umn(tmp_path / "text.mat")
    (tmp_path / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64")
    with pytest.raises(BadInputError, match=r"new\.mat: must be a MATLAB .* 7.3; save it with -v7"):
        read_umn(tmp_path / "new.mat")
    with pytest.raises(BadInputError, match=r"nowhere\.mat: no such file"):
        read_umn(tmp_path / "nowhere.mat")


def test_formats_go_by_their_names():
    assert {"umn", "csv"} <= set(importer_names())
    with pytest.raises(BadInputError, match="format 'px4': not one of csv, pos"):
        importer_named("px4")


def test_the_command_line_turns_it_into_a_folder_that_compares(thor, tmp_path):
    folder, place = tmp_path / "thor75", tmp_path / "figures.json"
    assert main(["import", str(thor), "--format", "umn", "--out", str(folder)]) == 0
    names = "closed-form,batch,rtk"
    words = ["--method", names, "--noise", "stated", "--json", str(place)]
    words += ["--from", "300", "--until", "400"]  # it flies
    assert main(["compare", str(folder), *words]) == 0
    methods = json.loads(place.read_text())["methods"]
    assert methods["batch"]["rmse_deg"]["pitch"] < 1.0
    assert methods["rtk"]["failure"].startswith("attitude: flight")

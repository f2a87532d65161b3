"""Estimates as CSV."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import exp, from_euler, to_euler
from fgnav.io.exports.recorded import load_estimate, save_estimate
from fgnav.io.exports.tables import ESTIMATE, SUMMARY, write_outcome
from fgnav.io.flight.columns import EULER, EULER_SIGMA, PLACE, POSITION_SIGMA, VELOCITY
from fgnav.io.flight.local_frame import attitude_to_n, place_to_n, velocity_to_n
from fgnav.messages import note
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

ORIGIN = Origin(latitude_rad=1.3, longitude_rad=0.2, height_m=100.0)


def estimate(rng, whole=True) -> Estimate:
    n = 4
    spread = rng.normal(size=(n, 3, 3))
    covariance = spread @ spread.swapaxes(1, 2)
    extra = {
        "p_n_m": rng.normal(0, 1000, (n, 3)),
        "v_n_mps": rng.normal(0, 50, (n, 3)),
        "position_covariance_m2": covariance,
        "velocity_covariance_m2ps2": np.tile(np.diag([0.01, 0.04, 0.09]), (n, 1, 1)),
        "attitude_covariance_rad2": covariance * 1e-6,
    }
    R_nb = from_euler(*rng.uniform(-1, 1, (3, n)))
    return Estimate(
        method="m", t_s=np.arange(n) / 2, n_epochs=n, R_nb=R_nb, **(extra if whole else {})
    )


def read(path):
    names = path.read_text().splitlines()[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


def columns(table, *names):
    return np.stack([table[name] for name in names], axis=1)


def test_exported_estimate_leads_back_to_the_estimate(tmp_path):
    want = estimate(np.random.default_rng(1))
    write_outcome(tmp_path, want, ORIGIN, {})
    got = read(tmp_path / ESTIMATE)
    p_n_m = place_to_n(ORIGIN, columns(got, "latitude_deg", "longitude_deg", "height_m"))
    np.testing.assert_allclose(p_n_m, want.p_n_m, rtol=0, atol=1e-6)
    v = velocity_to_n(ORIGIN, p_n_m, columns(got, "vn_mps", "ve_mps", "vd_mps"))
    np.testing.assert_allclose(v, want.v_n_mps, rtol=0, atol=1e-9)
    R_nb = attitude_to_n(ORIGIN, p_n_m, columns(got, "roll_deg", "pitch_deg", "yaw_deg"))
    np.testing.assert_allclose(R_nb, want.R_nb, rtol=0, atol=1e-12)
    assert list(got)[:10] == ["t_s", *PLACE, *VELOCITY, *EULER]


def test_sigmas_keep_the_total_variance_and_agree_with_a_sample(tmp_path):
    rng = np.random.default_rng(7)
    want = estimate(rng)
    write_outcome(tmp_path, want, ORIGIN, {})
    got = read(tmp_path / ESTIMATE)
    trace = np.trace(want.position_covariance_m2, axis1=1, axis2=2)
    sigma_m = columns(got, *POSITION_SIGMA)
    np.testing.assert_allclose((sigma_m**2).sum(axis=1), trace, rtol=1e-9)
    np.testing.assert_allclose(got["sigma_ve_mps"], 0.2, rtol=1e-3)
    delta = rng.multivariate_normal(np.zeros(3), want.attitude_covariance_rad2[0], 20_000)
    to_n = ORIGIN.local_ned(want.p_n_m[:1])[0]
    euler_deg = np.degrees(to_euler(to_n.T @ want.R_nb[0] @ exp(delta)))
    np.testing.assert_allclose(columns(got, *EULER_SIGMA)[0], euler_deg.std(axis=0), rtol=0.03)


def test_columns_of_what_is_not_estimated_are_absent(tmp_path):
    want = estimate(np.random.default_rng(1), whole=False)
    write_outcome(tmp_path, want, ORIGIN, {})
    got = read(tmp_path / ESTIMATE)
    assert list(got) == ["t_s", "roll_deg", "pitch_deg", "yaw_deg"]
    np.testing.assert_allclose(np.radians(columns(got, "yaw_deg")[:, 0]), to_euler(want.R_nb)[:, 2])


def test_a_summary_speaks_of_the_estimate_beside_it_or_both_stay_as_they_were(tmp_path):
    made = estimate(np.random.default_rng(1))
    write_outcome(tmp_path, made, ORIGIN, {"flight": "f"})
    with pytest.raises(ValueError, match="JSON compliant"):
        write_outcome(tmp_path, made, ORIGIN, {"flight": np.nan})
    summary = json.loads((tmp_path / SUMMARY).read_text())
    assert (summary["flight"], summary["estimate"]["rows"]) == ("f", 4)
    written = (tmp_path / summary["estimate"]["file"]).read_bytes()
    assert summary["estimate"]["sha256"] == hashlib.sha256(written).hexdigest()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["estimate.csv", "summary.json"]


def test_an_origin_of_numpy_s_floats_and_messages_come_back(tmp_path):
    origin = Origin(latitude_rad=np.radians(40.0), longitude_rad=np.radians(-4.0), height_m=700.0)
    message = note("E401", method="m")
    want = replace(estimate(np.random.default_rng(1)), notes=(message,))
    flight = Flight(name="f", start_gps_s=1e9, origin=origin)
    save_estimate(want, flight, tmp_path / "e.npz")
    got = load_estimate(tmp_path / "e.npz")
    assert (got.origin, got.estimate.notes) == (origin, (str(message),))

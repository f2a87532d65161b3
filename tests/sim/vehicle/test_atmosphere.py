import ambiance
import numpy as np
import pytest
from scipy.signal import welch

from fgnav.checks import BadInputError
from fgnav_sim.vehicle.atmosphere import dryden, us_1976
from fgnav_sim.vehicle.forces import air_at


def test_the_table_is_the_standard_atmosphere_between_its_points_and_across_its_layers() -> None:
    height_m = np.concatenate([np.linspace(-4900, 80900, 3001), [11019.07, 11019.0, 20063.1]])
    found = np.array([air_at(us_1976(), h) for h in height_m])
    exact = ambiance.Atmosphere(height_m)
    assert np.abs(found[:, 0] / exact.density - 1).max() < 1e-8
    assert np.abs(found[:, 1] / exact.speed_of_sound - 1).max() < 1e-9


def test_above_the_table_density_fades_without_a_step() -> None:
    heights = [80_995.0, 81_005.0, 81_105.0, 120_000.0]
    below, above, higher, space = (air_at(us_1976(), h)[0] for h in heights)
    assert above == pytest.approx(below, rel=5e-3)
    assert 0 <= space < 1e-2 * higher < below


def test_gusts_have_drydens_strength_scale_and_spectrum() -> None:
    direction = np.array([1.0, 1.0, 0.0])
    gust = dryden(
        np.random.default_rng(7), sigma_mps=2.0, direction_n=direction, length_m=4e6,
        scale_m=500.0,
    )  # fmt: skip
    along = gust @ direction / np.sqrt(2)
    for component in (along, gust @ [-1, 1, 0] / np.sqrt(2), gust[:, 2]):
        assert component.std() == pytest.approx(2.0, rel=0.05)
    waves, density = welch(np.column_stack([along, gust[:, 2]]).T, fs=1 / 5.0, nperseg=8192)
    x = (2 * np.pi * 500.0 * waves) ** 2
    longitudinal = 4 * 4.0 * 500.0 / (1 + x)  # one-sided, per cycle a metre
    transverse = 2 * 4.0 * 500.0 * (1 + 3 * x) / (1 + x) ** 2
    band = (waves > 1e-4) & (waves < 1e-2)
    assert np.mean(density[0, band] / longitudinal[band]) == pytest.approx(1.0, abs=0.05)
    assert np.mean(density[1, band] / transverse[band]) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({"sigma_mps": 0.0}, "sigma_mps: must be positive"),
        ({"length_m": -1.0}, "length_m: must be positive"),
        ({"direction_n": np.zeros(3)}, "direction_n: must not be zero"),
    ],
)
def test_bad_gusts_are_named(changes: dict, rule: str) -> None:
    good = {"sigma_mps": 1.0, "direction_n": np.ones(3), "length_m": 1e3}
    with pytest.raises(BadInputError, match=rule):
        dryden(np.random.default_rng(1), **{**good, **changes})

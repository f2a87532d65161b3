"""A live module is a source of factors, and its export is the same one."""

import numpy as np
import pytest
import torch

from fgnav import BadInputError, Batch, Forward, NeuralFactor, Smoother
from fgnav.graph.build import flight_values
from fgnav.graph.keys import Timeline
from fgnav_models import learn
from tests.models.learn.small import RATE_HZ, Sensor, flown, plain_input, wind


def linearised(source, flight, problem):
    """Return the rows of a source's factors where the search of a flight starts."""
    values = flight_values(problem, problem.start)
    made = source(flight, Timeline(t_s=problem.t_s, gyroscope=True))
    return np.array([one.factor.linearize(values).augmentedJacobian() for one in made])


@pytest.fixture(scope="module")
def flight():
    return flown(1)


def airspeed(flight, module=None, **more):
    more = {"frame": "b", "records": {"wind": wind(flight, 2)}} | more
    return learn.factor(module or Sensor().float(), "velocity", [plain_input()], **more)


@pytest.mark.parametrize("method", [Smoother, Batch, Forward])
def test_a_live_module_is_a_factor_of_every_method(flight, method):
    without = method(noise="nominal", factors=())(flight)
    estimate = method(noise="nominal", factors=(airspeed(flight),))(flight)
    assert estimate.converged
    assert any(one.what == "Sensor" for one in estimate.consistency)
    assert estimate.sigma_deg[-1, 2] < without.sigma_deg[-1, 2] / 5


@pytest.mark.parametrize("form", ["log_sigma", "cholesky", 0.7])
def test_an_exported_module_makes_the_same_factors(flight, tmp_path, form):
    module = Sensor(3, 6 if form == "cholesky" else 3).float()
    if form == 0.7:
        module = torch.nn.Sequential(torch.nn.Flatten(), torch.nn.Linear(9, 3))
    problem = Batch(noise="nominal").prepare(flight).problem
    live = airspeed(flight, module, covariance=form, name="airspeed")
    manifest = learn.export(live, tmp_path)
    stored = NeuralFactor(manifest, records={"wind": wind(flight, 2)})
    ours, theirs = (linearised(one, flight, problem) for one in (live, stored))
    assert len(ours) > 20
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6 * np.abs(theirs).max())
    assert (tmp_path / "airspeed.md").exists()


def test_what_it_learns_later_it_says_at_once(flight):
    module = Sensor().float()
    source, problem = airspeed(flight, module), Batch(noise="nominal").prepare(flight).problem
    before = linearised(source, flight, problem)
    with torch.no_grad():
        module.uncertain += 1.0
    after = linearised(source, flight, problem)
    np.testing.assert_allclose(after, before / np.e, rtol=1e-5, atol=1e-7)


class Says(torch.nn.Module):
    def __init__(self, *answers):
        super().__init__()
        self.answers = answers

    def forward(self, x):
        return tuple(torch.tensor([answer]).expand(len(x), -1) for answer in self.answers)


THREE = [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("module", "more", "line"),
    [
        (Says([1.0, 2.0], THREE), {}, r"velocity has 3 numbers, 'velocity' has 2"),
        (Says(THREE), {}, r"must return 2 tensors \(velocity, uncertainty\), returns 1"),
        (Says(THREE, [1.0, 2.0]), {}, "log_sigma of velocity has 1 or 3 numbers, has 2"),
        (
            Says(THREE, [1.0, 0.0, -1.0, 0.0, 0.0, 1.0]),
            {"covariance": "cholesky"},
            "diagonal of the Cholesky factor must be positive",
        ),
        (Says(THREE, [float("nan")] * 3), {}, "not finite in 64 of 64 windows"),
        (Says(THREE), {"covariance": -1.0}, "sigma"),
        (
            Says(THREE, THREE),
            {"unit": "km/h"},
            "unit: must be m/s, a unit of velocity, got",
        ),
        (Says(THREE, THREE), {"frame": None}, "frame: velocity may be in n or b; state it"),
        (torch.nn.Linear(7, 3), {"covariance": 1.0}, r"stops at windows wind \(64, 3, 3\)"),
    ],
)
def test_a_module_that_breaks_the_contract_is_refused_in_one_line(flight, module, more, line):
    with pytest.raises(BadInputError, match=line) as caught:
        airspeed(flight, module, **more)
    assert "\n" not in str(caught.value)


def test_an_input_is_what_training_windows_are():
    rng = np.random.default_rng(1)
    seen = 3.0 + 2.0 * rng.standard_normal((500, 4, 2))
    one = learn.input_of("photodiodes", seen, RATE_HZ, unit="A", frame="b")
    assert (one.window, len(one.range)) == (4, 2)
    np.testing.assert_allclose(one.mean, 3.0, atol=0.2)
    assert one.inside(seen).all()
    assert not one.inside(seen + 100.0).any()
    with pytest.raises(BadInputError, match="state unit and frame of this record"):
        learn.input_of("photodiodes", seen, RATE_HZ)
    with pytest.raises(BadInputError, match=r"windows must be finite, \(k, window, channels\)"):
        learn.input_of("accelerometer", seen[0], RATE_HZ)

"""A network whose errors are drawn by the very sigma that it gives, on flights with truth."""

import json

import numpy as np
import pytest
from onnx import helper

from fgnav import BadInputError, Batch, NeuralFactor, cli
from fgnav.evaluation.networks import calibration, referee
from fgnav.evaluation.networks.comparison import NO_NETWORK, constant_of
from fgnav.io.flight.folder import save_flight
from fgnav.neural.manifest import Covariance
from fgnav.neural.records import Record
from fgnav_sim.scenario import FixesTable
from tests.methods.simulated import flown
from tests.neural import graphs
from tests.turns import turning

RATE_HZ, OVER_S, FLIGHTS = 10.0, 1.0, 6
SIGMAS = (0.1, 1.0)  # m or m/s


@pytest.fixture(scope="module", name="flights")
def simulated():
    """Return turns with rare fixes."""
    fixes = FixesTable(rate_hz=2.0, velocity_noise_mps=1.0)
    return [turning(rng, fixes=fixes) for rng in np.random.default_rng(5).spawn(FLIGHTS)]


@pytest.fixture(scope="module", name="drawn")
def of_flights(flights):
    """Return errors of each flight's velocities, (n, 3), and the record that has them."""
    return recorded(flights, lambda truth: truth.v_n_mps)


def recorded(flights, quantity):
    """Return errors, drawn by one of two sigmas, and records of a quantity of the truth."""
    made = []
    for rng, flight in zip(np.random.default_rng(6).spawn(FLIGHTS), flights, strict=True):
        truth = flight.truth[:: round(1 / RATE_HZ / np.diff(flight.truth.t_s[:2]).item())]
        sigma = rng.choice(SIGMAS, (len(truth.t_s), 1))
        error = sigma * rng.standard_normal((len(truth.t_s), 3))
        values = np.hstack([quantity(truth) + error, np.log(sigma)])
        made.append((error, Record(t_s=truth.t_s, values=values, unit="m/s", frame="n")))
    return made


def written(folder, measures="velocity", **more):
    """Write a network that hands on what its record has."""
    nodes = [
        helper.make_node("Split", ["x", "sizes"], ["y", "s"], axis=1),
    ]
    weights = {"sizes": np.array([3, 1])}
    content = graphs.model(nodes, {"x": (4,)}, {"y": (3,), "s": (1,)}, weights)
    one = graphs.seen("anemometer", 1, channels=4, rate_hz=RATE_HZ, unit="m/s")
    one = type(one)(**{key: getattr(one, key) for key in one.__struct_fields__} | {"frame": "n"})
    output = graphs.told("y", measures, Covariance(form="log_sigma", name="s"), frame="n", **more)
    return graphs.written(folder, "anemometer", content, one, output)


def test_a_right_sigma_is_found_right_and_worth_more_than_the_best_constant(
    flights, drawn, tmp_path
):
    records = [{"anemometer": record} for _, record in drawn]
    found = referee([written(tmp_path)], flights, Batch(noise="nominal"), records=records)
    (one,) = found.calibrations
    assert one.answered == 1.0
    assert abs(one.network.nees - 1) < 4 * np.sqrt(2 / (3 * one.count))
    assert one.gain.high < 0
    assert one.network.energy < one.constant.energy
    for bin_ in (one.bins[0], one.bins[-1]):
        assert abs(bin_.rms / bin_.predicted - 1) < 0.15
    for k, sigmas in enumerate(one.sigmas):  # of all others' answers; the first has no window yet
        others = np.concatenate([error[1:] for j, (error, _) in enumerate(drawn) if j != k])
        np.testing.assert_allclose(sigmas, np.sqrt((others**2).mean(axis=0)), rtol=1e-5)
    for against in (NO_NETWORK, constant_of("anemometer")):
        gained = found.worth("velocity_rmse_mps", "anemometer", against)
        assert gained.flights == FLIGHTS
        assert gained.difference.high < 0
    assert "\nvelocity RMS, m/s " in str(found)


def moved(truth):
    """Return displacements of a second; of the first one no answer counts."""
    steps = round(OVER_S * RATE_HZ)
    return truth.p_n_m - truth.p_n_m[np.maximum(np.arange(len(truth.t_s)) - steps, 0)]


@pytest.mark.parametrize(
    ("measures", "quantity", "more"),
    [("position", lambda truth: truth.p_n_m, {}), ("displacement", moved, {"over_s": OVER_S})],
)
def test_positions_and_displacements_have_their_own_errors(
    flights, tmp_path, measures, quantity, more
):
    drawn = recorded(flights, quantity)
    network = written(tmp_path, measures, **more)
    factors = [NeuralFactor(network, records={"anemometer": record}) for _, record in drawn]
    found = calibration(factors, flights)
    begin = round(OVER_S * RATE_HZ) if more else 1
    errors = np.concatenate([error[begin:] for error, _ in drawn])
    assert (found.unit, found.count) == ("m", len(errors))
    assert found.rmse == pytest.approx(np.sqrt((errors**2).sum(axis=1).mean()), rel=1e-4)
    assert abs(found.network.nees - 1) < 4 * np.sqrt(2 / (3 * found.count))
    assert found.gain.high < 0


def test_flights_that_a_network_cannot_see_are_counted_and_one_alone_has_no_constant(
    flights, drawn, tmp_path
):
    records = [{"anemometer": record} for _, record in drawn]
    found = referee(
        [written(tmp_path)],
        flights[:3],
        Batch(noise="nominal"),
        records=[*records[:2], {}],
    )
    assert found.worth("velocity_rmse_mps", "anemometer", NO_NETWORK).flights == 2
    assert "has no 'anemometer'" in found.flights.flights[2].failures["anemometer"]
    with pytest.raises(BadInputError, match="1 of 1 flights have three answers or more; give two"):
        referee([written(tmp_path)], flights[:1], Batch(), records=records[:1])
    with pytest.raises(BadInputError, match="have one name twice"):
        referee([NeuralFactor(written(tmp_path))] * 2, flights, Batch())


def test_the_command_writes_figures_and_a_picture_or_one_line(flights, tmp_path, capsys):
    for k, flight in enumerate((*flights[:2], flown("demo", 5.0))):
        save_flight(flight, tmp_path / "flights" / str(k))
    folder = tmp_path / "network"
    folder.mkdir()
    graphs.heading(folder, value=0.5, spread=np.log(2.0))
    words = ["referee", str(folder), "--flights", str(tmp_path / "flights"), "--noise", "nominal"]
    files = ["--json", str(tmp_path / "net.json"), "--report", str(tmp_path / "net.png")]
    assert cli.main([*words, *files]) == 0
    shown = capsys.readouterr().out
    assert "attitude RMS, deg" in shown
    assert "has no 'gyroscope'" in shown
    content = json.loads((tmp_path / "net.json").read_text())
    assert content["networks"]["net"]["worth"][NO_NETWORK]["position_rmse_m"]["flights"] == 2
    assert (tmp_path / "net.png").read_bytes()[1:4] == b"PNG"
    graphs.heading(folder, form="cholesky", spread=-0.1)
    assert cli.main(words) == 2
    error = capsys.readouterr().err
    assert "diagonal of the Cholesky factor must be positive" in error
    assert error.count("\n") == 1
    assert cli.main([*words, "--method", "rtk"]) == 2
    assert "--noise: only" in capsys.readouterr().err

"""The ambiguity networks as resolvers, against the integers that the simulator put in."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.gnss.difference import double_differences
from fgnav.integers.resolvers.registry import resolver_named
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav_models.features import wrapped
from fgnav_models.runtime.ambiguity import AmbiguityNetwork, classification, regression
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Motion, Sine
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate

SWING = Sine(amplitude_deg=20.0)


def scenario(**changes):
    gnss = {"choose": 6, "receiver_mask_deg": 10.0, "elevation_weights": "uniform", **changes}
    return Scenario(
        name="swing",
        duration_s=3.0,
        motion=Motion(roll=SWING, pitch=SWING, yaw=SWING),
        gnss=GnssTable(**gnss),
    )


@pytest.fixture(scope="module")
def flight():
    """Return three seconds whose range has the precision that the networks were made for."""
    precise = scenario(code_noise_m=0.0005, phase_noise_m=0.0005)
    return simulate(precise, np.random.default_rng(3))


@pytest.fixture(scope="module")
def differences(flight):
    return double_differences(flight)


def right(differences, flight):
    return resolver_named("truth")(differences, flight).cycles


@pytest.mark.parametrize("network", ["ambiguity-classification", "ambiguity-regression"])
def test_integers_away_from_half_cycles_are_right(network, differences, flight):
    integers = resolver_named(network)(differences, flight)
    assert integers.resolver == network
    rest, _ = wrapped(differences.phase_m / differences.wavelength_m)
    clear = integers.fixed & (np.abs(rest) < 0.35)
    assert integers.fixed.sum() == 30 * 35
    assert clear.sum() > 500
    np.testing.assert_array_equal(integers.cycles[clear], right(differences, flight)[clear])


def test_order_of_channels_does_not_matter(differences, flight):
    order = np.array([3, 1, 5, 0, 4, 2])
    names = {k: tuple(np.array(getattr(differences, k))[order]) for k in ("satellites", "signals")}
    per_channel = ("wavelength_m", "group", "elevation_rad", "code_m", "phase_m", "arc")
    columns = {k: getattr(differences, k)[..., order] for k in per_channel}
    variances = ("code_variance_m2", "phase_variance_m2")
    columns |= {k: getattr(differences, k)[:, order] for k in variances}
    reference = np.argsort(order)[differences.reference]
    other = replace(
        differences, **names, **columns, e_n=differences.e_n[:, order], reference=reference
    )
    integers, turned = (classification()(d, flight) for d in (differences, other))
    np.testing.assert_array_equal(turned.cycles, integers.cycles[..., order])
    np.testing.assert_array_equal(turned.fixed, integers.fixed[..., order])


def test_epoch_that_lacks_a_link_is_not_fixed_and_counted(differences, flight):
    phase_m = differences.phase_m.copy()
    at = np.flatnonzero(~differences.is_reference[4])[0]
    phase_m[4, 2, at] = np.nan
    integers = classification()(replace(differences, phase_m=phase_m), flight)
    assert not integers.fixed[4].any()
    assert integers.fixed.sum() == 29 * 35
    (loss,) = integers.unused
    assert "wants six satellites" in loss.reason
    assert loss.count == 34


def test_epochs_whose_code_is_noisier_than_in_training_are_not_fixed_and_counted(
    differences, flight
):
    variance_m2 = differences.code_variance_m2.copy()
    variance_m2[7:] = 0.3**2
    integers = classification()(replace(differences, code_variance_m2=variance_m2), flight)
    assert integers.fixed[:7].sum() == 7 * 35
    assert not integers.fixed[7:].any()
    (loss,) = integers.unused
    assert loss.reason.startswith("range noise m outside 0.0005 to 0.003 m, network ambiguity-cla")
    assert loss.count == 23 * 35


def test_other_signals_are_not_fixed_and_counted():
    two = scenario(signals={"G": ("1C", "5Q")}, code_noise_m=0.0005, phase_noise_m=0.0005)
    flight = simulate(two, np.random.default_rng(3))
    differences = double_differences(flight)
    integers = classification()(differences, flight)
    of_1c = np.array(differences.signals) == "1C"
    assert integers.fixed[..., of_1c].sum() == 30 * 35
    assert not integers.fixed[..., ~of_1c].any()
    (loss,) = integers.unused
    assert loss.reason.startswith("not GPS 1C")
    assert loss.count == 30 * 35


def test_less_likely_integers_are_left_out_and_counted(differences, flight):
    every, sure = (AmbiguityNetwork(probability_min=p)(differences, flight) for p in (0.0, 0.99))
    assert 0.8 * 30 * 35 < sure.fixed.sum() < every.fixed.sum()
    np.testing.assert_array_equal(sure.cycles[sure.fixed], every.cycles[sure.fixed])
    (loss,) = sure.unused
    assert loss.reason == "probability below 0.99"
    assert loss.count == every.fixed.sum() - sure.fixed.sum()
    wrong = every.cycles != right(differences, flight)
    assert (sure.fixed & wrong).sum() < (every.fixed & wrong).sum()


def test_methods_take_networks_as_resolvers(flight):
    estimate = MaximumLikelihood(resolver=classification())(flight)
    assert estimate.integers.resolver == "ambiguity-classification"


def test_another_array_is_refused(differences, flight):
    moved = differences.baselines_b_m + np.array([0.0, 0.0, 0.01])
    with pytest.raises(BadInputError, match="knows the source paper's eight antennas"):
        classification()(replace(differences, baselines_b_m=moved), flight)
    few = simulate(
        Scenario(duration_s=1.0, gnss=GnssTable(), antennas_b_m=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))),
        np.random.default_rng(1),
    )
    with pytest.raises(BadInputError, match="take 'constrained'"):
        classification()(double_differences(few), few)


def test_probability_that_is_none_is_refused(differences, flight):
    with pytest.raises(BadInputError, match="probability_min: must be from 0"):
        AmbiguityNetwork(probability_min=1.0)
    unsure = replace(regression(), probability_min=0.5)
    with pytest.raises(BadInputError, match="the network states no probabilities"):
        unsure(differences, flight)

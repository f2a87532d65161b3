"""Networks of integers state the contract that factors do, and are refused as those are."""

import shutil

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.neural import NeuralFactor
from fgnav.neural.integers import integer_answers
from fgnav_models.runtime import ambiguity, resolver
from fgnav_models.runtime.factors import manifest
from fgnav_models.runtime.load import WEIGHTS, for_resolver, load
from tests.neural import graphs

TRUST = WEIGHTS / "trust.json"
WRONG = {
    "unit": (
        ("inputs", 0, "unit"),
        "m",
        r"inputs\[0\].unit: must be 1, as the resolver gives",
    ),
    "frame": (("inputs", 0, "frame"), "b", r"inputs\[0\].frame: must be none, as the resolver giv"),
    "sensor": (("inputs", 0, "sensor"), "accelerometer", r"inputs\[0\].unit: must be m/s2"),
    "other features": (("inputs", 0, "sensor"), "colours", "inputs: the sensors must be candidate"),
    "window": (("inputs", 0, "window"), 3, r"inputs\[0\].window: 'candidate' takes"),
    "manifold": (("output", "manifold"), "R1", "output.manifold: must be Z, the manifold of integ"),
    "output's unit": (("output", "unit"), "m", "output.unit: must be cycle, a unit of integers"),
    "covariance for probability": (
        ("output", "covariance"),
        {"form": "log_sigma", "name": "none"},
        "output.covariance.form: must be probability or posterior or none, a form of integers",
    ),
    "another probability": (
        ("output", "covariance"),
        {"form": "probability", "name": "none"},
        "output.covariance.form: must be posterior, got probability",
    ),
    "sigma": (
        ("output", "covariance"),
        {"form": "none", "sigma": [0.1]},
        "output.covariance.sigma: must have none, of integers, has 1",
    ),
    "half-life": (("output", "half_life_s"), 1.0, "output.half_life_s: must be 0 of integers"),
    "domain": (("domain",), [], "domain: must state antennas, baseline_m, code_sigma_m, groups"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_manifest_is_one_line(tmp_path, wrong):
    place, value, text = WRONG[wrong]
    path = tmp_path / "trust.json"
    for file in (TRUST, TRUST.with_suffix(".onnx")):
        shutil.copy(file, tmp_path)
    graphs.changed(path, place, value)
    with pytest.raises(BadInputError, match=rf"^{path}: key {text}") as raised:
        for_resolver(path, resolver.GIVEN, {"posterior"}, set(resolver.FIGURES))
    assert "\n" not in str(raised.value)


def test_states_and_integers_are_not_taken_for_each_other():
    with pytest.raises(BadInputError, match=r"key output\.measures: must be integers, of a reso"):
        load(manifest("gravity"))
    with pytest.raises(BadInputError, match=r"key output\.measures: integers are of a resolver, "):
        NeuralFactor(TRUST)


def test_answers_that_are_no_probabilities_or_of_another_shape_are_refused():
    network = load("ambiguity-classification")
    with pytest.raises(BadInputError, match=r"key inputs\[0\]: 'features' takes rows of "):
        integer_answers(network, [np.zeros((2, 1, 35))])
    far = np.zeros((2, 1, 36))
    far[1] = 2e3
    answers = integer_answers(network, [far])
    assert answers.within.tolist() == [True, False]
    assert ((answers.sure >= 0) & (answers.sure <= 1)).all()


def test_the_ambiguity_networks_fit_their_resolver():
    for name in ("ambiguity-classification", "ambiguity-regression"):
        assert ambiguity.AmbiguityNetwork(network=name).name == name
        assert ambiguity._loaded(name).manifest.licence == "BSD-3-Clause"

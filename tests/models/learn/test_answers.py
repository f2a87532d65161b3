"""Answers and scores in torch are those of the library."""

import numpy as np
import pytest
import torch

from fgnav.evaluation.figures import energy_score, negative_log_likelihood
from fgnav.evaluation.reference import truth_at
from fgnav.geometry.rotations import log, transpose
from fgnav.neural.measures import MEASURES
from fgnav_models import learn
from fgnav_models.learn.answers import answers_in_si
from tests.models.learn.sensors import CASES, FREEDOM, UNIT, drawn
from tests.models.learn.small import Sensor


@pytest.mark.parametrize(("measures", "frame", "form", "more"), CASES)
def test_outputs_mean_what_they_mean_to_the_factor(measures, frame, form, more):
    f, rng = FREEDOM.get(measures, 3), np.random.default_rng(1)
    widths = MEASURES[measures].widths
    unit, d = measures in UNIT, widths[-1]
    module = Sensor(d, f * (f + 1) // 2 if form == "cholesky" else f, 1, unit=unit)
    seen = learn.input_of("sensor", np.ones((1, 1, d)), 1.0, unit="unit", frame=frame)
    factor = learn.factor(module, measures, [seen], covariance=form, frame=frame, **more)
    for width in widths:
        raw = rng.normal(size=(5, width))
        if width == 9:
            raw = 0.2 * raw + np.eye(3).ravel()
        elif unit:
            raw /= np.linalg.norm(raw, axis=1, keepdims=True)
        uncertain = np.exp(0.1 * rng.normal(size=(5, len(module.uncertain))))
        answers = factor.network.read([raw, uncertain])
        outputs = [torch.from_numpy(raw), torch.from_numpy(uncertain)]
        value, covariance = answers_in_si(factor.network.manifest.output, outputs)
        np.testing.assert_allclose(value, answers.value, rtol=0, atol=1e-12)
        np.testing.assert_allclose(covariance, answers.covariance, rtol=1e-12)


def test_scores_are_those_of_evaluations():
    trained, factor, *_ = drawn(0)
    found = learn.posterior(trained, [factor])
    truth = truth_at(trained.truth, found.t_s)
    error = log(transpose(found.R_nb.detach().numpy()) @ truth.R_nb)
    covariance = found.covariance.detach().numpy()[:, :3, :3]
    nll, energy = (of(error, covariance) for of in (negative_log_likelihood, energy_score))
    found_nll = learn.nll(found, trained.truth, ["attitude"])
    assert float(found_nll.detach()) == pytest.approx(nll, rel=1e-3)
    found_energy = learn.energy_score(found, trained.truth, "attitude")
    assert float(found_energy.detach()) == pytest.approx(energy, rel=3e-3)  # of nodes

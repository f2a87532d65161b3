"""The check of factors finds a wrong noise and a wrong Jacobian."""

import numpy as np
import pytest

from fgnav.graph import check_factors, pose, random_states, residual_factor, values_of


def heights(truth, rng, *, noise_m=0.2, slope=1.0):
    for k, p_n_m in enumerate(truth.p_n_m):
        measured = -p_n_m[2] + noise_m * rng.standard_normal()

        def jacobian(x):
            return (np.array([[0.0, 0.0, 0.0, *(-slope * x.rotation().matrix()[2])]]),)

        yield residual_factor(
            "height",
            [pose(k)],
            lambda x, measured=measured: [-x.z() - measured],
            [0.2],
            jacobian=jacobian,
        )


@pytest.mark.parametrize(
    ("fault", "consistent", "jacobian"),
    [({}, True, True), ({"noise_m": 0.4}, False, True), ({"slope": 1.01}, True, False)],
    ids=["right", "noise", "jacobian"],
)
def test_noise_of_twice_the_size_and_a_jacobian_of_one_per_cent_are_found(
    fault, consistent, jacobian
):
    rng = np.random.default_rng(1)
    truth = random_states(300, rng)
    check = check_factors(list(heights(truth, rng, **fault)), values_of(truth), rng)
    assert check.consistent is consistent
    assert (check.jacobian < 1e-7) is jacobian

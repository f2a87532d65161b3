import dataclasses

import numpy as np
import pytest

from fgnav.attitude import RotationQuadratic
from fgnav.checks import BadInputError, NoSolutionError
from fgnav.integers.resolvers.resolve import resolve
from fgnav.integers.resolvers.truth import Truth, attitude_at
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.types.integers import Integers

from .simulated import errors_rad, flown, nees


@dataclasses.dataclass(frozen=True)
class Off:
    """Truth with one wrong integer at some epochs, or none of them fixed."""

    epochs: tuple[int, ...] = ()
    nothing: bool = False
    name: str = "off"

    def __call__(self, differences, flight):
        right = Truth()(differences, flight)
        cycles, fixed = right.cycles.copy(), right.fixed & (not self.nothing)
        first = np.argwhere(fixed[0])
        for k in self.epochs:
            cycles[k, first[3, 0], first[3, 1]] += 1
        cycles[~fixed] = 0
        return Integers(resolver=self.name, cycles=cycles, fixed=fixed, ratio=right.ratio)


def test_errors_are_within_a_tenth_of_the_bound_and_consistent():
    flight = flown("demo", 40.0)
    estimate = MaximumLikelihood(resolver=Truth())(flight)
    assert estimate.available == 1
    differences, integers = resolve(flight, Truth())
    R_nb, _ = attitude_at(flight.truth, estimate.t_s)
    form = RotationQuadratic.of_double_differences(differences, integers)
    bound = np.linalg.inv(form.information_at(R_nb))
    error = errors_rad(flight, estimate)
    ratio = np.sqrt((error**2).mean(axis=0) / np.einsum("nii->ni", bound).mean(axis=0))
    assert (ratio < 1.1).all()
    assert 2.5 < nees(error, estimate.attitude_covariance_rad2) < 3.5


def test_an_epoch_with_a_wrong_integer_is_not_answered_but_counted():
    flight = flown("demo", 5.0)
    estimate = MaximumLikelihood(resolver=Off(epochs=(7, 11)))(flight)
    assert len(estimate.t_s) == estimate.n_epochs - 2
    assert not np.isin(flight.observations.t_s[[7, 11]], estimate.t_s).any()
    lost = {loss.reason: loss.count for loss in estimate.unused}
    assert lost["residuals of the fixed array fail the chi-square test"] == 2


def test_nothing_fixed_is_no_solution_and_says_why():
    with pytest.raises(NoSolutionError, match=r"attitude: no epoch.*do not"):
        MaximumLikelihood(resolver=Off(nothing=True))(flown("demo", 5.0))


def test_a_false_alarm_rate_of_nothing_is_refused():
    with pytest.raises(BadInputError, match="false_alarm: must be positive"):
        MaximumLikelihood(false_alarm=0.0)

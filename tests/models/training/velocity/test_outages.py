"""Flights that lose GNSS for good, and the factor that suits them best."""

import numpy as np
import pytest
import torch

from fgnav.checks import NoSolutionError
from fgnav_models import learn
from fgnav_models.training.velocity.outages import OutageFlight, Outages, outage_flights, tuned
from fgnav_models.training.velocity.vehicles.world import VehiclesWorld
from tests.models.learn.small import plain_input, wind

WORLD = VehiclesWorld(car=0.0, aeroplane=0.0)  # others may go straight, and nothing shows a heading
OUTAGES = Outages(gnss_s=10.0, outage_s=(3.0, 4.0))


@pytest.fixture(scope="module")
def flights():
    made = outage_flights(WORLD, OUTAGES, 2, rng=np.random.default_rng(8))
    return [OutageFlight.of(flight) for flight in made]


def test_nothing_but_inertial_samples_determines_the_states_in_an_outage(flights):
    for one in flights:
        fixes = one.flight.flight.fixes[0]
        assert fixes.t_s[-2] < OUTAGES.gnss_s < OUTAGES.gnss_s + 2.5 < fixes.t_s[-1]
        posterior = one.posterior([])
        in_outage = posterior.t_s > fixes.t_s[-2]
        sigma_m = posterior.covariance[:, 3:6, 3:6].diagonal(dim1=1, dim2=2).sum(1).sqrt().numpy()
        assert np.diff(posterior.t_s).max() < 0.2
        assert (np.diff(sigma_m[in_outage]) > 0).all()
        assert sigma_m[-1] > 3 * sigma_m[~in_outage].max()
        assert one.outage.t_s[0] >= OUTAGES.gnss_s - 0.25
        assert len(one.outage.t_s) < len(one.flight.truth.t_s) / 2


class Last(torch.nn.Module):
    """The newest sample."""

    def forward(self, windows):
        """Return velocities."""
        return windows[:, -1]


def test_the_factor_is_chosen_by_which_the_truth_is_likeliest(flights):
    one, records = flights[0], {"wind": wind(flights[0].flight.flight, seed=3)}  # to 0.5 m/s
    sure, right, vague = (
        learn.factor(Last(), "velocity", [plain_input()], covariance=x, frame="b", records=records)
        for x in (0.05, 0.5, 5.0)
    )
    assert tuned([sure, right, vague], [one]) is right
    with pytest.raises(NoSolutionError, match="none of 0 flights"):
        tuned([right], [])

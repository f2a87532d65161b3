"""The small flights, written once per process."""

import pytest

from tests.robustness.outcomes import undamaged
from tests.robustness.small_flights import write_flights


@pytest.fixture(scope="session")
def whole_flights(tmp_path_factory):
    """Return both flights with what each method says of them."""
    folder = tmp_path_factory.mktemp("robustness")
    return [undamaged(flight, folder / "undamaged") for flight in write_flights(folder)]

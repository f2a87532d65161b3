import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.checks import BadInputError
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.at_times import at_times
from fgnav.methods.rtk import Rtk
from fgnav.methods.smoother import Batch
from tests.methods.simulated import flown

BATCH = Batch(resolver=Truth())


def test_a_rate_gives_multiples_of_its_period_within_the_flight():
    found = at_times(BATCH, None, 25.0)(flown("demo", 4.0))
    assert_allclose(found.t_s, np.arange(98) / 25, atol=1e-12)
    assert found.method == "batch"
    assert found.available == 1.0


def test_a_table_gives_its_times(tmp_path):
    table = tmp_path / "times.csv"
    table.write_text("t_s\n0.55\n1.23\n")
    found = at_times(BATCH, table, None)(flown("demo", 4.0))
    assert_allclose(found.t_s, [0.55, 1.23])


def test_neither_is_the_method_itself():
    assert at_times(BATCH, None, None) is BATCH


def test_times_that_cannot_be_given_are_refused(tmp_path):
    table = tmp_path / "times.csv"
    with pytest.raises(BadInputError, match="--at and --rate: name one of them"):
        at_times(BATCH, table, 10.0)
    with pytest.raises(BadInputError, match="rtk knows its own epochs alone"):
        at_times(Rtk(), None, 10.0)
    with pytest.raises(BadInputError, match="--rate: must be positive"):
        at_times(BATCH, None, -1.0)
    with pytest.raises(BadInputError, match=r"times\.csv"):
        at_times(BATCH, table, None)

import numpy as np

from fgnav.graph.types.arrays import contiguous
from tests.graph.factors import cases, sensors


def test_states_of_any_layout_are_the_same_to_a_kernel():
    at = cases.random_states(4, np.random.default_rng(1), sensors.constants("another"))
    odd = at._replace(R_nb=at.R_nb.swapaxes(1, 2), p_n_m=at.p_n_m[:, ::-1])
    odd.v_n_mps.flags.writeable = False
    which = np.arange(8)[::2]
    ready, rows = contiguous(odd, which)
    for one, other in zip(ready, odd, strict=True):
        assert one.flags.carray
        np.testing.assert_array_equal(one, other)
    assert rows.flags.carray
    assert rows.tolist() == which.tolist()


def test_states_that_are_ready_are_not_copied():
    at, which = (
        cases.random_states(4, np.random.default_rng(2), sensors.constants("another")),
        np.arange(4),
    )
    ready, rows = contiguous(at, which)
    assert ready is at
    assert rows is which

import numpy as np

from fgnav.graph.sensor_factor import parts_of
from fgnav.graph.types.arrays import contiguous
from tests.graph.factors import cases


def test_states_of_any_layout_are_the_same_to_a_kernel():
    at = cases.random_states(4, cases.constants(2), np.random.default_rng(1))
    odd = at._replace(R_nb=at.R_nb.swapaxes(1, 2), p_n_m=at.p_n_m[:, ::-1])
    odd.v_n_mps.flags.writeable = False
    which = np.arange(8)[::2]
    ready, rows = contiguous(odd, which)
    for one, other in zip(ready, odd, strict=True):
        assert one.flags.carray
        np.testing.assert_array_equal(one, other)
    assert rows.flags.carray
    assert rows.tolist() == which.tolist()


def test_columns_are_found_in_their_parts():
    shared = cases.constants(3, 2, 6)
    assert parts_of(shared, (-1, -1)) == ()
    assert parts_of(shared, (0, 2, -1)) == (0,)
    assert parts_of(shared, (8, 3)) == (1, 2)

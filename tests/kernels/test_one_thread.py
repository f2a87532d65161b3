"""BLAS has one thread within the context, and what it had behind it."""

import numpy as np
import scipy.linalg  # brings its own BLAS
from threadpoolctl import threadpool_info, threadpool_limits

from fgnav.kernels.one_thread import one_thread


def threads():
    return [
        library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"
    ]


def test_blas_has_one_thread_for_a_while():
    assert scipy.linalg.cholesky(np.eye(2)).shape == (2, 2)
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        with one_thread():
            assert set(threads()) == {1}
        assert threads() == before

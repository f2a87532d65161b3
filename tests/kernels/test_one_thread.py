"""BLAS has one thread within the context, and what it had behind it."""

import numpy as np
import scipy.linalg  # brings its own BLAS
from threadpoolctl import threadpool_info, threadpool_limits

from fgnav.kernels.one_thread import one_thread
from fgnav.methods.smoother import Smoother
from tests.robustness.drawn.flights import right_flight


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


def test_the_smoother_has_one_thread_and_its_bytes_do_not_hang_on_more():
    flight = right_flight("fixes", 640_000_000)
    with threadpool_limits(2, user_api="blas"):
        of_two = Smoother()(flight)
    with threadpool_limits(1, user_api="blas"):
        of_one = Smoother()(flight)
    for name in ("R_nb", "attitude_covariance_rad2", "velocity_covariance_m2ps2"):
        assert getattr(of_two, name).tobytes() == getattr(of_one, name).tobytes()

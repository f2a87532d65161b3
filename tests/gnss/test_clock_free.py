"""Clocks eliminated from links: against a dense projection."""

import numpy as np
from numpy.testing import assert_allclose

from fgnav.gnss.clock_free import clock_free


def test_it_is_the_weight_less_what_clocks_explain():
    rng = np.random.default_rng(0)
    n, a, group = 3, 4, np.array([0, 0, 0, 1, 1])
    seen = rng.random((n, a, 5)) < 0.8
    seen[:, 0] = seen[:, 1:].any(axis=1)
    variance_m2 = rng.uniform(1.0, 4.0, (n, 5))
    values = np.broadcast_to(np.eye(a * 5).reshape(a, 5, -1), (n, a, 5, a * 5))
    found = clock_free(group, seen, variance_m2, values)
    receivers = np.kron(np.eye(a), (group[:, None] == [0, 1]).astype(float))
    clocks = np.hstack([np.tile(np.eye(5), (a, 1)), receivers])
    for k in range(n):
        root = np.diag((seen[k] / np.sqrt(variance_m2[k])).ravel())
        Q = root @ clocks
        P = root @ (np.eye(a * 5) - Q @ np.linalg.pinv(Q)) @ root
        assert_allclose(found.normal[k], P, atol=1e-12)
        assert_allclose(found.weighted[k].reshape(a * 5, -1), P, atol=1e-12)
        assert_allclose(found.certain[k].ravel(), np.diag(P), atol=1e-12)

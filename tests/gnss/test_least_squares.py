import numpy as np
from scipy.stats import chi2

from fgnav.gnss.least_squares import FALSE_ALARM, fit, fit_consistent


def problems(rng: np.random.Generator, n: int = 50, m: int = 8, p: int = 4):
    A = rng.standard_normal((n, m, p))
    variance = rng.uniform(0.5, 2.0, (n, m))
    x = rng.standard_normal((n, p))
    y = np.einsum("nmp,np->nm", A, x) + np.sqrt(variance) * rng.standard_normal((n, m))
    return A, y, variance, x


def test_every_problem_equals_numpys_solution_of_it():
    rng = np.random.default_rng(1)
    A, y, variance, _ = problems(rng)
    use = rng.random(y.shape) < 0.8
    y[~use] = np.nan
    fits = fit(A, y, variance, use)
    for k in range(len(y)):
        if use[k].sum() < 4:
            assert not fits.solved[k]
            continue
        root = 1 / np.sqrt(variance[k, use[k]])
        x, *_ = np.linalg.lstsq(A[k, use[k]] * root[:, None], y[k, use[k]] * root, rcond=None)
        np.testing.assert_allclose(fits.x[k], x, atol=1e-8)
        N = (A[k, use[k]] * root[:, None] ** 2).T @ A[k, use[k]]
        np.testing.assert_allclose(fits.covariance[k], np.linalg.inv(N), rtol=1e-7)
        np.testing.assert_allclose(fits.gain[k] @ np.nan_to_num(y[k]), x, atol=1e-8)


def test_errors_are_those_the_covariance_states():
    A, y, variance, x = problems(np.random.default_rng(2), n=4000)
    fits = fit(A, y, variance, np.ones(y.shape, dtype=bool))
    error = fits.x - x
    squared = np.einsum("np,npq,nq->n", error, np.linalg.inv(fits.covariance), error)
    low, high = chi2(4 * 4000).ppf([0.001, 0.999]) / 4000
    assert low < squared.mean() < high
    assert (~fits.consistent).mean() < 10 * FALSE_ALARM


def test_unknowns_nothing_speaks_of_are_absent_and_harm_no_other():
    A, y, variance, _ = problems(np.random.default_rng(3))
    wider = np.concatenate([A, np.zeros((*y.shape, 1))], axis=2)
    use = np.ones(y.shape, dtype=bool)
    plain, wide = fit(A, y, variance, use), fit(wider, y, variance, use)
    np.testing.assert_allclose(wide.x[:, :4], plain.x, atol=1e-10)
    assert np.isnan(wide.x[:, 4]).all()
    np.testing.assert_array_equal(wide.freedom, plain.freedom)


def test_too_few_measurements_are_no_solution():
    A, y, variance, _ = problems(np.random.default_rng(4), m=3)
    fits = fit(A, y, variance, np.ones(y.shape, dtype=bool))
    assert not fits.solved.any()
    assert np.isnan(fits.x).all()
    assert not fit(A, y, variance, np.zeros(y.shape, dtype=bool)).solved.any()


def test_gross_errors_are_dropped_one_by_one():
    A, y, variance, x = problems(np.random.default_rng(5))
    y[7, 2] += 300.0
    y[7, 5] -= 200.0
    y[9, 0] += 100.0
    fits, use = fit_consistent(A, y, variance, np.ones(y.shape, dtype=bool))
    np.testing.assert_array_equal(np.argwhere(~use), [[7, 2], [7, 5], [9, 0]])
    assert fits.consistent.all()
    assert np.abs(fits.x - x).max() < 8.0


def test_with_one_spare_measurement_an_error_shows_but_is_not_blamed_on_any():
    A, y, variance, _ = problems(np.random.default_rng(6), m=5)
    y[3, 1] += 1000.0
    fits, use = fit_consistent(A, y, variance, np.ones(y.shape, dtype=bool))
    assert use.all()
    assert fits.solved[3]
    assert not fits.consistent[3]

"""What models and a base leave of phases and codes, against the truth."""

import numpy as np
import pytest

from fgnav.assembly.truncation import truncated
from fgnav.gnss.undifferenced import undifferenced
from fgnav_sim.gnss.tables import OutageTable, SlipsTable
from tests.gnss.based import antenna_n_m, flown


def left_m(flight, of):
    """Residuals of phases at the true place, a clock of each epoch and a constant of each arc free.

    Times the root of their freedom's share: as large as the noise.
    """
    apart = antenna_n_m(flight, of.t_s) - of.place_n_m
    y = of.phase_m + np.einsum("nmi,ni->nm", of.e_n, apart)
    epoch, channel = np.nonzero(of.arc >= 0)
    _, arc = np.unique(of.arc[epoch, channel], return_inverse=True)
    A = np.hstack([np.eye(len(of.t_s))[epoch], np.eye(arc.max() + 1)[arc]])
    y = y[epoch, channel] - y[epoch, channel].mean()
    x, _, rank, _ = np.linalg.lstsq(A, y, rcond=1e-9)
    return (A @ x - y) * np.sqrt(len(y) / (len(y) - rank))


@pytest.mark.parametrize("base", [False, True])
def test_an_arc_leaves_a_constant_and_noise(base):
    flight = flown(span_s=8.0)
    of = undifferenced(flight, base=base)
    rms_m = np.sqrt(np.mean(left_m(flight, of) ** 2))
    assert rms_m == pytest.approx(np.nanmean(of.phase_sigma_m), rel=0.1)
    assert of.integers is base


def test_code_tells_the_same_range():
    flight = flown(span_s=8.0)
    of = undifferenced(flight)
    apart = antenna_n_m(flight, of.t_s) - of.place_n_m
    code_m = of.code_m + np.einsum("nmi,ni->nm", of.e_n, apart)
    code_m -= np.nanmean(code_m, axis=1, keepdims=True)
    assert np.sqrt(np.nanmean(code_m**2)) == pytest.approx(0.3, rel=0.1)


def test_a_slip_and_an_outage_begin_new_arcs():
    outage = OutageTable(from_s=3.0, until_s=4.0, azimuth_deg=(0.0, 90.0))
    slips = SlipsTable(rate_per_hour=200.0, flagged_share=0.0)
    flight = flown(base=None, span_s=8.0, outages=(outage,), slips=slips)
    of = undifferenced(flight)
    assert len(np.unique(of.arc[of.arc >= 0])) > (of.arc >= 0).any(axis=0).sum()
    rms_m = np.sqrt(np.mean(left_m(flight, of) ** 2))
    assert rms_m == pytest.approx(np.nanmean(of.phase_sigma_m), rel=0.1)


def test_nothing_before_a_cut_depends_on_what_follows():
    flight = flown(base=None, span_s=8.0, slips=SlipsTable(rate_per_hour=200.0))
    whole, part = undifferenced(flight), undifferenced(truncated(flight, 4.03))
    n = len(part.t_s)
    for name in ("place_n_m", "e_n", "phase_m", "code_m", "error_sigma_m"):
        np.testing.assert_allclose(
            getattr(part, name), getattr(whole, name)[:n], rtol=0, atol=1e-6, err_msg=name
        )
    np.testing.assert_array_equal(part.arc, whole.arc[:n])

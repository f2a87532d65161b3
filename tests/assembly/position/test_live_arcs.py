"""Live arcs, block by block: at the true place their rows are white, whatever comes and goes."""

import tracemalloc

import numpy as np
import pytest
from scipy.special import chdtri

from fgnav.assembly.position.numbered_arcs import Observed
from fgnav.assembly.position.phases import antenna_phase
from fgnav.gnss.undifferenced import undifferenced
from fgnav.graph.types.parameters import Parameters
from fgnav_sim.gnss.tables import LossOfLockTable, OutageTable, SlipsTable
from tests.gnss.based import antenna_n_m, flown

DISTURBED = {
    "nothing": {},
    "slips": {"slips": SlipsTable(rate_per_hour=200.0, flagged_share=0.0)},
    "lost lock": {"loss_of_lock": LossOfLockTable(rate_per_hour=300.0, mean_s=0.5)},
    "an outage": {"outages": (OutageTable(from_s=3.0, until_s=5.0),)},
    "few satellites": {
        "outages": (OutageTable(from_s=3.0, until_s=5.0, azimuth_deg=(0.0, 240.0)),)
    },
    "errors that move": {"message_errors": True, "satellite_error_rate_mps": 1e-3},
    "two carriers": {"signals": {"G": ("1C", "5Q"), "E": ("1C",)}},
}


def of_flight(flight, *, causal=False):
    of, truth = undifferenced(flight, base=flight.base is not None), flight.truth
    rows = np.arange(len(of.t_s))
    R_nb = truth.R_nb[np.searchsorted(truth.t_s, of.t_s - 1e-6)]
    observed = Observed(of, rows, rows, np.zeros(3))
    phases = antenna_phase((observed,), of.t_s, R_nb, Parameters(), causal=causal)
    return phases.phase, antenna_n_m(flight, of.t_s), phases.notes


def least_squares(phase, place_n_m):
    """Return the sum of squares at the true places and the best A, with its freedom."""
    sizes = [one.size for one in phase.blocks]
    first, rows, right = np.cumsum([0, *sizes]), [], []
    for j, one in enumerate(phase.blocks):
        row = np.zeros((len(one.right), first[-1]))
        row[:, first[j] : first[j + 1]] = one.after
        if j:
            row[:, first[j - 1] : first[j]] = -one.before
        rows.append(row)
        right.append(one.right)
    for k, j, one in zip(phase.row, phase.block, phase.rows, strict=True):
        row = np.zeros((len(one.z), first[-1]))
        row[:, first[j] : first[j + 1]] = one.H
        rows.append(row)
        right.append(one.z - one.G @ place_n_m[k])
    A, b = np.vstack(rows), np.concatenate(right)
    x = np.linalg.lstsq(A, b, rcond=None)[0]
    return float(((A @ x - b) ** 2).sum()), len(b) - first[-1]


@pytest.mark.parametrize("which", DISTURBED)
def test_rows_are_white_at_the_truth(which):
    flight = flown.__wrapped__(base=None, span_s=8.0, seed=20_001, **DISTURBED[which])
    phase, place_n_m, _ = of_flight(flight)
    squares, freedom = least_squares(phase, place_n_m)
    assert chdtri(freedom, 1 - 1e-3) * 0.95 < squares < chdtri(freedom, 1e-3) * 1.05


def test_a_block_lasts_half_a_second_and_has_code_once_a_second():
    flight = flown(base=None, span_s=8.0)
    phase, _, _ = of_flight(flight)
    assert [one.begin_row for one in phase.blocks] == list(range(0, 80, 5))
    coded = [len(one.right) > one.size for one in phase.blocks]
    assert coded == [True, False] * 8


def test_rows_and_blocks_weigh_little_until_they_are_taken():
    flight = flown(base=None, span_s=8.0)
    tracemalloc.start()
    phase = of_flight(flight)[0]
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    taken = [*phase.rows, *phase.blocks]
    dense = sum(np.asarray(part).nbytes for one in taken for part in one)
    assert kept < dense / 2


def test_few_satellites_measure_all_the_same():
    flight = flown(base=None, span_s=8.0, **DISTURBED["few satellites"])
    phase, _, _ = of_flight(flight)
    inside = (phase.row >= 30) & (phase.row < 50)
    assert inside.sum() == 20
    assert phase.freedom[inside].max() < 4


def test_blocks_before_a_cut_are_the_same():
    from fgnav.assembly.truncation import truncated

    flight = flown(base=None, span_s=8.0, **DISTURBED["slips"])
    whole, part = of_flight(flight)[0], of_flight(truncated(flight, 4.03))[0]
    for one, other in zip(part.rows, whole.rows, strict=False):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-5)
    for one, other in zip(part.blocks, whole.blocks, strict=False):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("causal", [False, True])
@pytest.mark.parametrize("seed", range(20_001, 20_004))
def test_integers_against_a_base_are_right(seed, causal):
    flight = flown(span_s=8.0, seed=seed, wind_up=True)
    phase, place_n_m, notes = of_flight(flight, causal=causal)
    assert "integers known" in notes[0]
    squares, freedom = least_squares(phase, place_n_m)
    assert squares < 1.1 * chdtri(freedom, 1e-3)

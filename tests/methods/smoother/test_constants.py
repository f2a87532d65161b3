"""What holds for a whole flight: what may be asked for, and derivatives by it."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.methods.smoother import links
from fgnav.methods.smoother.array_shape import BaselineForm
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.by_gtsam import solve_by_gtsam
from fgnav.methods.smoother.chain import STATE
from fgnav.methods.smoother.constants import (
    ANTENNAS,
    BORESIGHT,
    GRAVITY,
    HEIGHT,
    IRON,
    LANDMARK,
    LEVER,
    PIECE,
    FlightConstant,
    asked,
    constant,
    constants_of,
    with_evidence,
)
from fgnav.methods.smoother.constants_found import constants_found, sentence, started_there
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.link_kernel import linearise, move
from fgnav.methods.smoother.residuals import residuals
from fgnav.methods.smoother.surroundings import Heights, MagneticField, with_offsets
from fgnav.rotations import transpose
from tests.methods.simulated import flown

from .flights import turning

LANDMARK_N_M = np.array([2000.0, 300.0, 10.0])
FIELD_N_UT = np.array([25.8, -0.2, 36.6])
ARMS_B_M = np.array([[1.0, 0.0, 0.1], [0.0, 0.5, 0.0], [-0.8, 0.1, 0.3]])
ROW = 4


def numbered(names, place, sigma=0.1):
    return constant("some", place, names, "m", sigma)


@pytest.fixture(scope="module")
def keyframes():
    """Every instrument, none of them quite as stated; constants start off zero."""
    rng = np.random.default_rng(0)
    keyframes = turning(rng, span_s=1.0, amplitude_deg=40).keyframes
    n, R_bn = len(keyframes.t_s), transpose(keyframes.R_nb)

    def seen(v_n, noise=0.02):
        e_b = np.einsum("nij,nj->ni", R_bn, v_n / np.linalg.norm(v_n, axis=1, keepdims=True))
        e_b += noise * rng.standard_normal((n, 3))
        return e_b / np.linalg.norm(e_b, axis=1, keepdims=True)

    three = ("x_b", "y_b", "z_b")
    times = ("at 0 s", "at 0.5 s", "at 1 s")
    drift = FlightConstant(
        name="barometer",
        place=HEIGHT,
        axes=times,
        unit="m",
        start=np.zeros(3),
        covariance=np.eye(3),
    )
    heights = Heights(
        down_n_m=keyframes.p_n_m[:, 2] + rng.standard_normal(n),
        sigma_m=0.5,
        arm_b_m=np.array([0.4, -0.2, 0.3]),
        place=np.linspace(0, 2, n),
        offset=drift,
    )
    field = MagneticField(
        directions=Directions.isotropic(seen(np.tile(FIELD_N_UT, (n, 1))), 0.01),
        field_n_ut=FIELD_N_UT,
        iron=constant("hard iron", IRON, three, "uT", 3.0),
    )
    constants = with_offsets(
        (
            numbered(("north", "east", "down"), LANDMARK, 10.0),
            numbered(("about y_b", "about z_b"), BORESIGHT),
            numbered(("about x_b", "about y_b"), GRAVITY),
            numbered(three, LEVER),
            numbered(three + three, PIECE),
            numbered(three, ANTENNAS),
            numbered(three, ANTENNAS + 2),
        ),
        heights,
        field,
    )
    root = rng.standard_normal((n, 9, 9)) * 20
    there = np.arange(n) > 1
    covariance = np.tile(np.diag([0.02, 0.1, 0.05]) ** 2, (n, 1, 1))
    return dataclasses.replace(
        keyframes,
        position=dataclasses.replace(
            keyframes.position,
            arm_b_m=np.array([0.5, -0.3, 0.1]),
            piece=np.where(np.arange(n) < ROW, 0, 1) - (np.arange(n) == ROW + 1),
        ),
        gravity=Directions.of("gravity", seen(keyframes.gravity_n_mps2), covariance),
        sight=Directions.isotropic(seen(LANDMARK_N_M - keyframes.p_n_m), 0.02),
        landmark_n_m=LANDMARK_N_M,
        heights=heights,
        field=field,
        baselines=BaselineForm(
            there=there,
            root=root * there[:, None, None],
            minimum=np.einsum("nij,kj->nki", keyframes.R_nb, ARMS_B_M + 0.01),
            baselines_b_m=ARMS_B_M,
        ),
        constants=tuple(
            dataclasses.replace(c, start=0.05 * rng.standard_normal(len(c.start)))
            for c in constants
        ),
    )


def linked(keyframes, states, row):
    """One link, whitened and squared, with the prior at the first keyframe."""
    n, width = len(keyframes.t_s), 2 * STATE + len(states.constants) + 1
    link, rows, motions = np.zeros((n, width, width)), np.arange(1, n), links.empty_motions(n)
    links.integrate(motions, rows, links.samples_of(keyframes), rows, keyframes.slot[:-1])
    senses, prior = links.senses_of(keyframes), links.prior_of(keyframes)
    linearise(link, states, motions, senses, prior, np.array([row]), 0)
    return link[row]


@pytest.mark.parametrize("row", [0, ROW])
def test_links_are_the_derivatives_of_their_cost_by_every_constant(keyframes, row):
    states = links.states_of(keyframes)
    here = linked(keyframes, states, row)
    b = len(states.constants)
    size = np.sqrt(np.diag(here)[2 * STATE : -1])
    assert b == 28
    # Two of three times of the drift, one of two stretches of positions.
    assert (size > 0).sum() == (28 if row == 0 else 24)
    for k in np.flatnonzero(size):
        h, costs = 1e-3 / size[k], []
        for sign in (1, -1):
            moved = states.copied()
            moved.constants[k] += sign * h
            costs.append(linked(keyframes, moved, row)[-1, -1])
        slope, expected = (costs[0] - costs[1]) / (2 * h), -2 * here[2 * STATE + k, -1]
        assert abs(slope - expected) < 1e-6 * size[k] * np.sqrt(here[-1, -1]), k


def test_links_are_the_derivatives_of_their_cost_by_the_state_beside_constants(keyframes):
    states = links.states_of(keyframes)
    here = linked(keyframes, states, ROW)
    size = np.sqrt(np.diag(here)[STATE : 2 * STATE])
    for k in range(9):
        h, costs, step = 1e-3 / size[k], [], np.zeros((1, STATE))
        for sign in (1, -1):
            moved = states.copied()
            step[0, k] = sign * h
            move(states, step, ROW, moved, ROW, wholly=True)
            costs.append(linked(keyframes, moved, ROW)[-1, -1])
        slope, expected = (costs[0] - costs[1]) / (2 * h), -2 * here[STATE + k, -1]
        assert abs(slope - expected) < 1e-5 * size[k] * np.sqrt(here[-1, -1]), k


def test_residuals_have_the_derivatives_of_finite_differences_by_every_constant(keyframes):
    solution = solve_batch(keyframes)
    found, h = residuals(keyframes, solution), 1e-5
    assert {"barometric height", "magnetic field", "line of sight"} < {p.what for p in found}
    for k in range(len(solution.shared.value)):
        parts = []
        for by in (h, -h):
            value = solution.shared.value.copy()
            value[k] += by
            shared = dataclasses.replace(solution.shared, value=value)
            parts.append(residuals(keyframes, dataclasses.replace(solution, shared=shared)))
        for part, a, b in zip(found, *parts, strict=True):
            numeric = (a.value - b.value) / (2 * h)
            scale = max(np.abs(part.jacobian).max(), 1.0)
            assert_allclose(part.jacobian[:, :, 9 + k] / scale, numeric / scale, rtol=0, atol=1e-6)


def test_a_solution_lists_what_was_asked_for_off_what_is_stated(keyframes):
    solution = solve_batch(keyframes)
    found = constants_found(keyframes, solution)
    assert [len(one.value) for one in found] == [3, 2, 2, 3, 3, 3, 3, 3]
    off = np.concatenate([one.value for one in found])
    assert_allclose(off[:3], solution.shared.value[:3] - LANDMARK_N_M, rtol=0, atol=1e-9)
    own = np.r_[3:16, 22:28]  # but for the offsets of positions
    assert_allclose(off[3:], solution.shared.value[own], rtol=0, atol=1e-12)
    again = started_there(keyframes, solution)
    assert_allclose(links.states_of(again).constants, solution.shared.value, rtol=0, atol=1e-9)
    assert_allclose(again.shared_mean, keyframes.shared_mean, rtol=0, atol=0)
    assert sentence(found[1]).startswith("Some, off what the flight states: about y_b ")


def test_an_error_common_to_all_positions_is_no_landmarks_own(keyframes):
    """With a metre of it, a landmark known to a centimetre keeps its place, and its doubt."""
    surveyed = dataclasses.replace(
        keyframes,
        constants=(numbered(("n", "e", "d"), LANDMARK, 0.01), *keyframes.constants[1:]),
        common_position_m2=np.eye(3),
    )
    found = constants_found(surveyed, solve_batch(surveyed))[0]
    assert np.abs(found.value).max() < 0.01
    assert_allclose(np.sqrt(np.diag(found.covariance)), 0.01, rtol=1e-3)


def test_words_state_what_and_how_well():
    words = asked(("landmark", "boresight=1.5", "antenna:a4=0.02", "lever-arm"))
    assert [(w.kind, w.antenna) for w in words] == [
        ("landmark", None),
        ("boresight", None),
        ("antenna", "a4"),
        ("lever-arm", None),
    ]
    assert [w.sigma for w in words] == [10.0, np.radians(1.5), 0.02, 0.3]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("landmrk",), "'landmrk' is none of landmark, boresight, gravity, lever-arm, antennas"),
        (("antenna",), "must name one, antenna:a4"),
        (("landmark:a4",), "'landmark:a4' is none of"),
        (("boresight=",), "after = comes a positive 1-sigma, got ''"),
        (("boresight=-1",), "after = comes a positive 1-sigma"),
        (("landmark", "landmark=3"), "'landmark' is asked for twice"),
        (("antennas", "antenna:a2"), "'antenna:a2' is asked for twice"),
    ],
)
def test_words_that_mean_nothing_are_named(words, text):
    with pytest.raises(BadInputError, match=text):
        asked(words)


@pytest.mark.parametrize(
    ("word", "text"),
    [
        ("landmark", r"estimate landmark: the flight has no \[seeker\]"),
        ("gravity", "estimate gravity: nothing tells the direction of gravity"),
        ("antenna:b7", "estimate antenna:b7: not one of a1, a2"),
        ("antenna:a1", "estimate antenna:a1: is the reference of the array; ask for lever-arm"),
    ],
)
def test_what_a_flight_has_not_cannot_be_estimated_with_it(word, text):
    with pytest.raises(BadInputError, match=text):
        constants_of(asked((word,)), flown("demo", 5.0), gravity=False)


def test_flights_without_an_array_have_no_places_of_antennas():
    alone = dataclasses.replace(flown("demo", 5.0), observations=None)
    with pytest.raises(BadInputError, match="the flight has no array of antennas"):
        constants_of(asked(("antennas",)), alone, gravity=False)


def test_a_detector_that_never_sees_tells_of_no_landmark():
    with pytest.raises(NoSolutionError, match="some: the detector never sees the landmark"):
        with_evidence((numbered(("a", "b"), BORESIGHT),), sight=False)


def test_gtsam_refuses_what_it_has_no_factors_for(keyframes):
    with pytest.raises(NoSolutionError, match="some: gtsam has factors for the landmark alone"):
        solve_by_gtsam(keyframes)


def test_gtsam_finds_the_landmark_where_the_batch_does():
    """It errs by angles and ours by their sines: some thousandths of a radian here."""
    rng = np.random.default_rng(2)
    keyframes = turning(rng, span_s=4.0).keyframes
    to_n_m = LANDMARK_N_M - keyframes.p_n_m
    e_b = np.einsum("nji,nj->ni", keyframes.R_nb, to_n_m)
    e_b += 1e-3 * np.linalg.norm(to_n_m, axis=1)[:, None] * rng.standard_normal(e_b.shape)
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    keyframes = dataclasses.replace(
        keyframes,
        sight=Directions.isotropic(e_b, 1e-3),
        landmark_n_m=LANDMARK_N_M + np.array([0.0, 5.0, -3.0]),
        constants=(numbered(("north", "east", "down"), LANDMARK, 30.0),),
    )
    ours, theirs = (solve(keyframes) for solve in (solve_batch, solve_by_gtsam))
    a, b = (constants_found(keyframes, solution)[0] for solution in (ours, theirs))
    sigma = np.sqrt(np.diag(a.covariance))
    assert np.abs((a.value - b.value) / sigma).max() < 0.05
    assert_allclose(np.sqrt(np.diag(b.covariance)), sigma, rtol=0.02)
    assert_allclose(theirs.shared.cross, ours.shared.cross, rtol=0, atol=0.05)

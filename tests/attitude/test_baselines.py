from dataclasses import replace

import numpy as np
import pytest

from fgnav.attitude.baselines import body_motion, paper_baselines, weighted_baselines
from fgnav.attitude.vector_pairs import sensitivity, wahba
from fgnav.geometry import rotations
from fgnav.gnss.single_point.solution import code_solution
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Arc, Motion
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import L1_M, link_covariance

ARRAY_B_M = np.array([[0, 0.5, 0], [1.0, 0, 0], [-0.8, 0.1, 0.3]])
MM = 1e-3


@pytest.fixture
def rng():
    return np.random.default_rng(29)


def made(rng, R_nb, *, per_group=(6, 5), missing=0.0, noise=1.0):
    """Double differences of the array with true integers, unequal weights and missing links."""
    e_n = np.stack([sky(sum(per_group), rng) for _ in R_nb])
    group = np.repeat(np.arange(len(per_group)), per_group)
    return synthetic(
        R_nb, e_n, rng, antennas_b_m=np.vstack([np.zeros(3), ARRAY_B_M]), group=group,
        sine=True, missing=missing, noise=noise,
    )  # fmt: skip


def random_rotations(rng, n):
    return rotations.exp(rng.uniform(-1.8, 1.8, (n, 3)))


@pytest.mark.parametrize("solve", [paper_baselines, weighted_baselines])
@pytest.mark.parametrize("missing", [0.0, 0.3])
def test_noise_free_phase_gives_the_exact_baselines(rng, solve, missing):
    R_nb = random_rotations(rng, 60)
    answer = solve(*made(rng, R_nb, missing=missing, noise=0.0))
    enough = np.isfinite(answer.b_n_m[..., 0])
    assert enough.mean() > 0.95
    truth = np.einsum("nij,bj->nbi", R_nb, ARRAY_B_M)
    np.testing.assert_allclose(answer.b_n_m[enough], truth[enough], rtol=0, atol=1e-9)


def test_paper_baselines_are_the_pseudo_inverse_of_equation_29(rng):
    differences, integers = made(rng, random_rotations(rng, 5), missing=0.2)
    answer = paper_baselines(differences, integers)
    for k in range(5):
        for i in range(len(ARRAY_B_M)):
            links = np.flatnonzero(integers.fixed[k, i])
            e_r = differences.e_n[k, differences.reference[k, differences.group[links]]]
            H = e_r - differences.e_n[k, links]
            rho_m = differences.phase_m[k, i, links] - L1_M * integers.cycles[k, i, links]
            np.testing.assert_allclose(answer.b_n_m[k, i], np.linalg.pinv(H) @ rho_m, atol=1e-10)


def test_weighted_baselines_are_generalised_least_squares_of_the_differences(rng):
    differences, integers = made(rng, random_rotations(rng, 5), missing=0.2)
    answer = weighted_baselines(differences, integers)
    for k in range(5):
        for i in range(len(ARRAY_B_M)):
            only = np.zeros(integers.fixed.shape[1:], dtype=bool)
            only[i] = integers.fixed[k, i]
            C = link_covariance(differences, k, only, differences.phase_variance_m2)
            links = np.flatnonzero(only[i])
            e_r = differences.e_n[k, differences.reference[k, differences.group[links]]]
            H = e_r - differences.e_n[k, links]
            rho_m = differences.phase_m[k, i, links] - L1_M * integers.cycles[k, i, links]
            P = np.linalg.inv(H.T @ np.linalg.solve(C, H))
            expected = P @ H.T @ np.linalg.solve(C, rho_m)
            np.testing.assert_allclose(answer.b_n_m[k, i], expected, rtol=0, atol=1e-10)
            np.testing.assert_allclose(answer.covariance_m2[k, i], P, rtol=1e-8, atol=1e-12)


def test_paper_covariance_is_that_of_the_pseudo_inverse(rng):
    differences, integers = made(rng, random_rotations(rng, 3))
    answer = paper_baselines(differences, integers)
    only = np.zeros(integers.fixed.shape[1:], dtype=bool)
    only[1] = integers.fixed[0, 1]
    C = link_covariance(differences, 0, only, differences.phase_variance_m2)
    links = np.flatnonzero(only[1])
    e_r = differences.e_n[0, differences.reference[0, differences.group[links]]]
    X = np.linalg.pinv(e_r - differences.e_n[0, links])
    np.testing.assert_allclose(answer.covariance_m2[0, 1], X @ C @ X.T, rtol=1e-8, atol=1e-12)


def test_weighted_errors_meet_their_covariance_and_beat_the_paper(rng):
    n = 1500
    R_nb = random_rotations(rng, n)
    differences, integers = made(rng, R_nb, missing=0.1)
    truth = np.einsum("nij,bj->nbi", R_nb, ARRAY_B_M)
    weighted = weighted_baselines(differences, integers)
    error_m = weighted.b_n_m - truth
    P = weighted.covariance_m2
    nees = np.einsum("nbi,nbi->nb", error_m, np.linalg.solve(P, error_m[..., None])[..., 0])
    # Three baselines share the reference antenna, so count independent epochs only.
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / n))
    paper_m = paper_baselines(differences, integers).b_n_m - truth
    assert np.sqrt((error_m**2).mean()) < np.sqrt((paper_m**2).mean())


@pytest.mark.parametrize("solve", [paper_baselines, weighted_baselines])
def test_two_differences_are_too_few(rng, solve):
    answer = solve(*made(rng, random_rotations(rng, 4), per_group=(3,)))
    assert np.isnan(answer.b_n_m).all()
    assert np.isnan(answer.covariance_m2).all()
    assert (answer.gain == 0).all()


@pytest.mark.parametrize("solve", [paper_baselines, weighted_baselines])
def test_a_group_reduced_to_its_reference_adds_nothing(rng, solve):
    R_nb = random_rotations(rng, 4)
    differences, integers = made(rng, R_nb, per_group=(6, 1))
    answer = solve(differences, integers)
    np.testing.assert_array_equal(answer.gain[..., 6], 0)


def flattened(differences, integers):
    """The same with every satellite in one vertical plane: the east component is open."""
    e_n = differences.e_n.copy()
    e_n[..., 1] = 0
    return replace(differences, e_n=e_n), integers


def test_satellites_in_a_plane_give_the_shortest_baseline_of_equation_32(rng):
    differences, integers = flattened(*made(rng, random_rotations(rng, 4), per_group=(6,)))
    answer = paper_baselines(differences, integers)
    np.testing.assert_allclose(answer.b_n_m[..., 1], 0, atol=1e-9)
    links = np.flatnonzero(integers.fixed[0, 0])
    H = differences.e_n[0, differences.reference[0, 0]] - differences.e_n[0, links]
    rho_m = differences.phase_m[0, 0, links] - L1_M * integers.cycles[0, 0, links]
    expected = np.linalg.lstsq(H, rho_m, rcond=None)[0]
    np.testing.assert_allclose(answer.b_n_m[0, 0], expected, rtol=0, atol=1e-9)


def test_satellites_in_a_plane_give_no_weighted_baseline(rng):
    answer = weighted_baselines(*flattened(*made(rng, random_rotations(rng, 4), per_group=(6,))))
    assert np.isnan(answer.b_n_m).all()


def test_pairs_weigh_each_baseline_by_its_inverse_variance(rng):
    R_nb = random_rotations(rng, 20)
    baselines = weighted_baselines(*made(rng, R_nb, missing=0.2))
    pairs = baselines.pairs(ARRAY_B_M, ("a2", "a3", "a4"))
    assert pairs.sources == ("baseline a2", "baseline a3", "baseline a4")
    known = np.isfinite(baselines.b_n_m[..., 0])
    assert (pairs.weight[~known] == 0).all()
    variance = np.trace(baselines.covariance_m2[known], axis1=1, axis2=2) / 3
    np.testing.assert_allclose(pairs.weight[known] * variance, 1.0)
    error = rotations.log(R_nb.swapaxes(1, 2) @ wahba(pairs).R_nb)
    assert np.degrees(np.sqrt((error**2).mean())) < 2.0


def test_attitude_errors_meet_the_covariance_carried_through_baselines(rng):
    n = 1500
    R_nb = random_rotations(rng, n)
    baselines = weighted_baselines(*made(rng, R_nb, missing=0.1))
    pairs = baselines.pairs(ARRAY_B_M, ("a2", "a3", "a4"))
    attitude = wahba(pairs)
    P = baselines.attitude_covariance_rad2(sensitivity(lambda p: wahba(p).R_nb, pairs))
    error = rotations.log(attitude.R_nb.swapaxes(1, 2) @ R_nb)
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[..., None])[..., 0])
    # 2 % for what the first order leaves out, with weak skies among random ones.
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / n) + 0.06)


def test_an_open_axis_has_the_variance_of_a_uniform_angle(rng):
    R_nb = random_rotations(rng, 5)
    baselines = weighted_baselines(*made(rng, R_nb))
    nose_b_m = np.zeros_like(ARRAY_B_M)
    nose_b_m[1] = ARRAY_B_M[1]
    only = replace(
        baselines, b_n_m=np.where(nose_b_m.any(axis=1)[:, None], baselines.b_n_m, np.nan)
    )
    pairs = only.pairs(ARRAY_B_M, ("a2", "a3", "a4"))
    S = sensitivity(lambda p: wahba(p).R_nb, pairs)
    P = wahba(pairs).with_open_axis(only.attitude_covariance_rad2(S))
    np.testing.assert_allclose(P[:, 0, 0], np.pi**2 / 3, rtol=1e-12)
    assert (np.degrees(np.sqrt(P[:, 1, 1])) < 5).all()


def orbiting(doppler=True, antennas_b_m=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), lost=()):
    """A simulated flight whose reference antenna loses its code at some epochs."""
    scenario = Scenario(
        duration_s=4.0,
        motion=Motion(path=Arc(speed_mps=50.0, radius_m=300.0)),
        gnss=GnssTable(rate_hz=5.0, code_noise_m=0.3),
        antennas_b_m=antennas_b_m,
    )
    flight = simulate(scenario, np.random.default_rng(2))
    code_m, doppler_hz = flight.observations.code_m.copy(), flight.observations.doppler_hz.copy()
    code_m[list(lost)] = np.nan
    if not doppler:
        doppler_hz[:] = np.nan
    return replace(
        flight, observations=replace(flight.observations, code_m=code_m, doppler_hz=doppler_hz)
    )


def level(flight):
    return np.broadcast_to(np.eye(3), (len(flight.observations.t_s), 3, 3))


def test_body_stands_a_lever_arm_from_its_antenna():
    flight = orbiting(antennas_b_m=((3.0, -4.0, 5.0), (4.0, -4.0, 5.0)))
    motion = body_motion(flight, flight.observations.t_s, level(flight))
    expected = code_solution(flight).p_n_m - [3.0, -4.0, 5.0]
    np.testing.assert_allclose(motion.p_n_m, expected, rtol=0, atol=1e-9)
    assert [one.code for one in motion.notes] == ["W504"]


def test_a_lost_code_solution_is_bridged_with_a_larger_variance():
    whole, holed = orbiting(), orbiting(lost=(7, 8))
    t_s = whole.observations.t_s
    plain, bridged = (body_motion(flight, t_s, level(flight)) for flight in (whole, holed))
    assert bridged.notes == ("Position is interpolated at 2 epochs without code solution.",)
    grown_m2 = (bridged.position_covariance_m2 - plain.position_covariance_m2)[[6, 7, 8, 9], 0, 0]
    # Three intervals of 0.2 s at 1 g: 9.8 * 0.36 / 8 = 0.44 m.
    np.testing.assert_allclose(grown_m2[[1, 2]], 0.44**2, rtol=0.1)
    np.testing.assert_allclose(grown_m2[[0, 3]], 0, atol=1e-12)
    apart_m = np.linalg.norm(bridged.p_n_m - plain.p_n_m, axis=1)
    assert apart_m.max() < 3.0  # code noise of 0.3 m and PDOP, and 0.3 m of arc


@pytest.mark.parametrize(
    ("changes", "has_place", "note"),
    [
        ({"lost": (0,)}, False, "No position: some epochs lie outside the code solutions."),
        ({"lost": range(20)}, False, "No position: "),
        ({"doppler": False}, True, "No velocity: some epochs lie outside those with Doppler."),
    ],
)
def test_what_codes_and_doppler_do_not_give_is_absent_with_a_note(changes, has_place, note):
    flight = orbiting(**changes)
    motion = body_motion(flight, flight.observations.t_s, level(flight))
    assert (motion.p_n_m is not None) == has_place
    assert motion.v_n_mps is None
    assert motion.notes[0].startswith(note)

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.gnss.difference import double_differences
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.observations import HALF_CYCLE
from tests.gnss import recordings
from tests.gnss.flights import Made, walker_orbits
from tests.integers.arrays import link_covariance

MM = 1e-3
ARMS = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0.8, 0.1], [-0.3, 0, 1.0]])
T_S = np.arange(0.0, 2.5, 0.1)


def changed(flight: Flight, **fields: FloatArray) -> Flight:
    assert flight.observations is not None
    return replace(flight, observations=replace(flight.observations, **fields))


def off_integer_m(differences: DoubleDifferences, modelled_m: FloatArray) -> FloatArray:
    """Return what is left of each phase after its nearest integer, (n, b, m)."""
    left = differences.phase_m - modelled_m
    return left - differences.wavelength_m * np.round(left / differences.wavelength_m)


def integers(differences: DoubleDifferences, modelled_m: FloatArray) -> FloatArray:
    return np.round((differences.phase_m - modelled_m) / differences.wavelength_m)


def reasons(differences: DoubleDifferences) -> dict[tuple[str, str], int]:
    return {(loss.what, loss.reason): loss.count for loss in differences.unused}


def drifting(t_s: FloatArray) -> FloatArray:
    """Return a clock that drifts, and jumps by a millisecond."""
    return 2e-4 + 1e-6 * t_s - np.where(t_s > 1.25, 1e-3, 0.0)


@pytest.mark.parametrize("doppler", [True, False])
@pytest.mark.parametrize(
    ("letters", "clock_s", "v_n_mps", "yaw_rate_radps"),
    [
        ("G", (), (100.0, -40.0, 5.0), 0.8),
        ("GEC", (), (100.0, -40.0, 5.0), 0.8),
        # The satellites alone move ranges by up to 0.8 m in a millisecond, the vehicle by 0.3 m.
        ("GE", (0.0, 1e-3, -1e-3, 5e-4), (300.0, 50.0, -10.0), 0.0),
        ("G", (drifting, 0.0, 0.0, 0.0), (80.0, 0.0, 0.0), 0.0),
    ],
)
def test_differences_are_the_array_plus_integers_whatever_clocks_do(
    letters, clock_s, v_n_mps, yaw_rate_radps, doppler
):
    made = Made(
        t_s=T_S,
        arms_b_m=ARMS,
        letters=letters,
        v_n_mps=v_n_mps,
        yaw_rate_radps=yaw_rate_radps,
        clock_s=clock_s,
        doppler=doppler,
    )
    limit_m = 0.1 * MM if clock_s else 0.05 * MM
    found = double_differences(made.flight())
    model = found.array_m(made.attitude(T_S))
    there = found.resolvable
    assert there.sum() > 0.6 * there.size
    assert np.abs((found.code_m - model)[there]).max() < limit_m
    assert np.abs(off_integer_m(found, model)[there]).max() < limit_m
    assert found.arc.max() == 0
    kept = integers(found, model)[:, there.all(axis=0)]
    assert (kept == kept[0]).all()
    of_reference = np.take_along_axis(found.phase_m, found.reference[:, None], axis=2)
    assert (of_reference == 0).all()


def test_noise_is_that_of_the_stated_covariance():
    t_s = np.arange(0.0, 40.0, 0.1)
    made = Made(t_s=t_s, arms_b_m=ARMS, code_sigma_m=0.5, phase_sigma_m=0.003)
    found = double_differences(made.flight())
    links = found.resolvable.all(axis=0)
    residual = off_integer_m(found, found.array_m(made.attitude(t_s)))[:, links]
    assert (found.reference == found.reference[0]).all()
    covariance = link_covariance(found, 0, links, found.phase_variance_m2)
    nees = np.einsum("ni,ij,nj->n", residual, np.linalg.inv(covariance), residual)
    # 400 epochs of links.sum() degrees of freedom: five sigmas of the mean.
    assert abs(nees.mean() / links.sum() - 1) < 5 * np.sqrt(2 / (400 * links.sum()))


def test_elevation_weights_divide_by_the_sine():
    flight = Made(t_s=T_S[:2], arms_b_m=ARMS[:2]).flight()
    noise = replace(flight.gnss_noise, elevation_weights="sine", phase_m=0.002)
    found = double_differences(replace(flight, gnss_noise=noise))
    used = np.isfinite(found.elevation_rad)
    expected = (0.002 / np.sin(found.elevation_rad[used])) ** 2
    np.testing.assert_allclose(found.phase_variance_m2[used], expected, rtol=1e-12)
    assert (found.phase_variance_m2[~used] == 1).all()


def test_the_mask_keeps_low_satellites_out_and_counts_them():
    flight = Made(t_s=T_S[:2], arms_b_m=ARMS[:2], letters="GE").flight()
    low = double_differences(flight)
    high = double_differences(replace(flight, elevation_mask_rad=np.radians(30.0)))
    assert np.nanmin(low.elevation_rad) < np.radians(30.0) <= np.nanmin(high.elevation_rad)
    assert reasons(high)["a2 link", "below the elevation mask"] > 0
    dropped = np.isnan(high.elevation_rad)
    assert (high.e_n[dropped] == 0).all()
    assert np.isnan(high.code_m[:, 0][dropped]).all()


def test_the_reference_is_the_highest_channel_most_antennas_track():
    flight = Made(t_s=T_S[:4], arms_b_m=ARMS).flight()
    plain = double_differences(flight)
    best = int(plain.reference[0, 0])
    assert best == np.nanargmax(plain.elevation_rad[0])
    code_m = flight.observations.code_m.copy()
    code_m[1:, 2, best] = np.nan
    found = double_differences(changed(flight, code_m=code_m))
    assert found.reference[0, 0] == best
    assert (found.reference[1:, 0] != best).all()
    assert np.isnan(found.code_m[1:, 1, best]).all()
    # Another reference, another integer: another arc.
    j = next(j for j in np.nonzero(np.isfinite(found.phase_m[:, 0]).all(axis=0))[0] if j != best)
    np.testing.assert_array_equal(found.arc[:, 0, j], [0, 1, 1, 1])


def test_a_slip_of_any_of_the_four_links_begins_a_new_arc():
    flight = Made(t_s=T_S[:20], arms_b_m=ARMS, letters="GE").flight()
    plain = double_differences(flight)
    reference = int(plain.reference[0, 0])
    other = next(
        j
        for j in np.nonzero(plain.resolvable.all(axis=(0, 1)))[0]
        if plain.group[j] == plain.group[reference]
    )
    for antenna, channel in ((0, other), (1, other), (0, reference), (1, reference)):
        phase = flight.observations.phase_cycles.copy()
        phase[10:, antenna, channel] += 3
        found = double_differences(changed(flight, phase_cycles=phase))
        np.testing.assert_array_equal(found.arc[[0, 9, 10, 19], 0, other], [0, 0, 1, 1])


def test_a_group_of_one_channel_is_not_usable():
    flight = Made(t_s=T_S[:2], arms_b_m=ARMS[:2], letters="GE").flight()
    code_m = flight.observations.code_m.copy()
    galileo = [j for j, s in enumerate(flight.observations.satellites) if s[0] == "E"]
    elevation = double_differences(flight).elevation_rad[0]
    names = double_differences(flight).satellites
    kept = max(
        (s for s in names if s[0] == "E"),
        key=lambda s: np.nan_to_num(elevation[names.index(s)]),
    )
    for j in galileo:
        if flight.observations.satellites[j] != kept:
            code_m[:, :, j] = np.nan
    found = double_differences(changed(flight, code_m=code_m))
    group = found.group[found.satellites.index(kept)]
    assert (found.reference[:, group] == -1).all()
    assert np.isnan(found.code_m[:, 0, found.satellites.index(kept)]).all()
    assert reasons(found)["a2 link", "only channel of its group"] == 2


def test_links_that_cannot_be_differenced_are_counted():
    flight = Made(t_s=T_S[:3], arms_b_m=ARMS[:3]).flight()
    plain = double_differences(flight)
    reference = int(plain.reference[0, 0])
    other = int(np.nonzero(plain.resolvable.all(axis=(0, 1)))[0][0])
    code_m, flags = flight.observations.code_m.copy(), flight.observations.lock_flags.copy()
    code_m[0, 0, other] = np.nan
    flags[1, 1, other] = HALF_CYCLE
    # In the last epoch no antenna but the first two tracks the reference's equals.
    code_m[2, 2, reference] = np.nan
    found = double_differences(changed(flight, code_m=code_m, lock_flags=flags))
    lost = reasons(found)
    assert lost["a2 link", "not tracked by the reference antenna"] == 1
    assert lost["a3 link", "not tracked by the reference antenna"] == 1
    assert lost["a2 link", "half-cycle ambiguity of the phase not resolved"] == 1
    assert np.isnan(found.phase_m[1, 0, other])
    assert np.isfinite(found.code_m[1, 0, other])
    assert found.arc[1, 0, other] == -1


def test_sick_and_unknown_satellites_are_counted_apart():
    orbits = walker_orbits("G")
    flight = Made(t_s=T_S[:3], arms_b_m=ARMS[:2]).flight(orbits)
    first, second = (
        flight.observations.satellites[j]
        for j in np.nonzero(np.isfinite(double_differences(flight).elevation_rad[0]))[0][:2]
    )
    records = orbits.records.copy()
    records["health"][records["satellite"] == first] = 1
    records = records[records["satellite"] != second]
    changed_orbits = replace(orbits, records=records)
    lost = reasons(double_differences(replace(flight, broadcast=changed_orbits)))
    assert lost["a2 link", "satellite not healthy"] == 3
    assert lost["a2 link", "no usable ephemeris"] == 3


def test_epochs_far_from_any_position_are_counted():
    t_s = np.array([0.0, 1.0, 60.0])
    flight = Made(t_s=t_s, arms_b_m=ARMS[:2]).flight()
    code_m = flight.observations.code_m.copy()
    code_m[2][:, 3:] = np.nan
    found = double_differences(changed(flight, code_m=code_m))
    assert reasons(found)["a2 link", "no position of the reference antenna"] > 0
    assert np.isnan(found.code_m[2]).all()


def test_epochs_without_links_stay_all_absent():
    flight = Made(t_s=T_S[:5], arms_b_m=ARMS[:2]).flight()
    code_m = flight.observations.code_m.copy()
    code_m[2] = np.nan
    found = double_differences(changed(flight, code_m=code_m))
    np.testing.assert_array_equal(found.t_s, T_S[:5])
    assert np.isnan(found.phase_m[2]).all()
    assert (found.reference[2] == -1).all()
    assert np.isfinite(found.phase_m[3]).any()


def test_an_epoch_with_too_few_satellites_for_a_position_still_has_differences():
    flight = Made(t_s=T_S[:5], arms_b_m=ARMS[:2]).flight()
    full = double_differences(flight)
    three = np.argsort(-np.nan_to_num(full.elevation_rad[2]))[:3]
    code_m = flight.observations.code_m.copy()
    code_m[2] = np.nan
    code_m[2][:, three] = flight.observations.code_m[2][:, three]
    found = double_differences(changed(flight, code_m=code_m))
    np.testing.assert_allclose(found.code_m[2, 0, three], full.code_m[2, 0, three], atol=0.01 * MM)


def test_differences_are_computed_once_per_flight():
    flight = Made(t_s=T_S[:2], arms_b_m=ARMS[:2]).flight()
    assert double_differences(flight) is double_differences(flight)


def test_blocks_of_epochs_join_without_a_seam(monkeypatch):
    flight = Made(t_s=T_S, arms_b_m=ARMS[:2], phase_sigma_m=0.003).flight()
    whole = double_differences(flight)
    monkeypatch.setattr("fgnav.gnss.single_differences.BLOCK", 7)
    monkeypatch.setattr("fgnav.gnss.single_point.solution.BLOCK", 7)
    parts = double_differences(replace(flight, name="parts"))
    np.testing.assert_allclose(parts.phase_m, whole.phase_m, atol=1e-6 * MM)
    np.testing.assert_array_equal(parts.arc, whole.arc)
    assert parts.unused == whole.unused


def test_fewer_than_two_antennas_are_not_enough():
    flight = Made(t_s=T_S[:2], arms_b_m=ARMS[:1]).flight()
    for one, has in ((flight, "1"), (replace(flight, observations=None), "no observations")):
        with pytest.raises(NoSolutionError, match=f"of two antennas or more, it has {has}"):
            double_differences(one)


@pytest.mark.parametrize("with_tables", [False, True])
def test_real_differences_are_integers_around_the_surveyed_baseline(shared, with_tables):
    flight = recordings.wettzell(shared)
    if with_tables:
        flight = replace(flight, precise=recordings.precise(shared))
    found = double_differences(flight)
    ranges_m = -found.e_n @ recordings.BASELINE_N_M
    reference = found.reference[:, found.group].clip(0)
    model = (ranges_m - np.take_along_axis(ranges_m, reference, axis=1))[:, None]
    off_m, there = off_integer_m(found, model), found.resolvable
    # GPS L1 C/A, Galileo E1, BeiDou B1I: number of links, RMS; the two stations' coordinates carry
    # a few millimetres themselves.
    carriers = [("G", "1C", 800, 6 * MM), ("E", "1C", 600, 6 * MM)]
    if not with_tables:  # of BeiDou the tables know the old satellites only
        carriers.append(("C", "2I", 500, 10 * MM))
    for letter, signal, least, rms_m in carriers:
        mine = np.array(
            [
                s[0] == letter and g == signal
                for s, g in zip(found.satellites, found.signals, strict=True)
            ]
        )
        links = there & mine
        assert links.sum() >= least
        assert np.sqrt(np.mean(off_m[links] ** 2)) < rms_m
        assert np.abs(off_m[links]).max() < 25 * MM
    whole = integers(found, model)
    for j in np.nonzero(there.any(axis=(0, 1)))[0]:
        for arc in np.unique(found.arc[there[:, 0, j], 0, j]):
            inside = there[:, 0, j] & (found.arc[:, 0, j] == arc)
            assert len(np.unique(whole[inside, 0, j])) == 1

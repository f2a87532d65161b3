"""Samples and their parts: integers that fit, and a split that lets nothing through."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav_models.training.ambiguity.data import Data, Rows, Samples, Shuffled, draw, parts_of
from fgnav_sim.data_sets.world import NoiseTable, RunsTable, SatellitesTable, World

QUIET = World(noise=NoiseTable(code_m=1e-6, phase_m=1e-6), runs=RunsTable(epochs=4))
INPUTS = ("range", "constellation")


def drawn(world=QUIET, count=48, seed=1, inputs=INPUTS):
    return draw(world, inputs, count, rng=np.random.default_rng(seed))


def days(runs=20, length=96):
    """Return samples of whole days without features: 15 minutes a step."""
    n = runs * length
    zeros = np.zeros((n, 1), dtype=np.int64)
    run = np.arange(n) // length
    return Samples(
        features=np.arange(n, dtype=np.float32)[:, None],
        cycles=zeros,
        rounded=zeros,
        is_present=np.ones((n, 1), dtype=bool),
        t_s=np.tile(np.arange(length) * 900.0, runs),
        run=run,
        first=run * length,
        satellites=2,
    )


def test_without_noise_rounding_is_right_and_the_integers_stay_within_the_papers_classes():
    samples = drawn()
    assert samples.cycles.shape == (48, 35)
    np.testing.assert_array_equal(samples.rounded, samples.cycles)
    assert 5 < np.abs(samples.cycles).max() <= 16
    np.testing.assert_array_equal(samples.rounded, np.round(samples.features[:, :35]))


def test_the_same_seed_gives_the_same_samples_and_another_others():
    one, two, other = drawn(), drawn(), drawn(seed=2)
    np.testing.assert_array_equal(one.features, two.features)
    assert not np.array_equal(one.features, other.features)


def test_fewer_satellites_leave_gaps_that_are_marked():
    table = SatellitesTable(choose=(4, 6), pick="random")
    world = World(satellites=table, noise=QUIET.noise, runs=RunsTable(epochs=2))
    samples = drawn(world)
    per_epoch = samples.is_present.reshape(48, 7, 5).sum(axis=2)
    assert set(np.unique(per_epoch)) == {3, 4, 5}
    # The lowest slots are the empty ones: a gap is followed by gaps alone.
    assert (np.diff(samples.is_present.reshape(48, 7, 5).astype(int), axis=2) <= 0).all()
    assert np.isfinite(samples.features).all()
    assert not samples.features[:, :35][~samples.is_present].any()


def test_fewer_slots_than_wanted_are_padded_with_gaps():
    table = SatellitesTable(choose=4)
    world = World(satellites=table, noise=QUIET.noise)
    samples = draw(world, INPUTS, 8, rng=np.random.default_rng(1), satellites=6)
    plain = drawn(world, count=8)
    assert (samples.satellites, plain.satellites) == (6, 4)
    is_present = samples.is_present.reshape(8, 7, 5)
    assert is_present[:, :, :3].all()
    assert not is_present[:, :, 3:].any()
    np.testing.assert_array_equal(
        samples.cycles[samples.is_present], plain.cycles[plain.is_present]
    )


def test_integers_no_network_can_answer_are_counted():
    long = ((0.0, 0.0, 0.0), (5.0, 0.0, 0.0))
    world = World(antennas_b_m=long, noise=QUIET.noise)
    samples = drawn(world)
    assert samples.unused[0].count == (~samples.is_present).sum() > 0
    assert "beyond 16" in samples.unused[0].reason


def test_several_signals_are_refused():
    world = World(satellites=SatellitesTable(signals={"G": ("1C",), "E": ("1C",)}, choose=4))
    with pytest.raises(BadInputError, match="the networks take one signal of one constellation"):
        drawn(world, count=2)


@pytest.mark.parametrize("window", [1, 3])
def test_parts_share_no_block_of_time_and_no_run(window):
    samples = days()
    parts = parts_of(samples, Data(epochs=1), window, rng=np.random.default_rng(3))
    rows = (parts.train, parts.validation, parts.test)
    hours = [set(np.floor(samples.t_s[r] / 3600.0)) for r in rows]
    runs = [set(samples.run[r]) for r in rows]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert not hours[i] & hours[j]
        assert not runs[i] & runs[j]
    for some in rows:  # nor does a window look out of its part
        for back in range(1, window):
            assert (
                set(np.floor(samples.t_s[some - back] / 3600.0))
                <= hours[[r is some for r in rows].index(True)]
            )
    lost = {loss.reason: loss.count for loss in parts.unused}
    assert sum(lost.values()) + sum(map(len, rows)) == len(samples.t_s)


def test_a_split_by_simulation_shares_all_of_the_time():
    samples = days()
    data = Data(epochs=1, split="simulations")
    parts = parts_of(samples, data, 1, rng=np.random.default_rng(3))
    assert not set(samples.run[parts.train]) & set(samples.run[parts.test])
    assert set(samples.t_s[parts.test]) <= set(samples.t_s[parts.train])
    assert len(parts.train) == 14 * 96
    assert not parts.unused


def test_short_runs_go_with_their_block_and_nothing_is_lost():
    samples = days(runs=480, length=4)
    one_hour = np.tile(np.arange(4) * 900.0, 480) + 3600.0 * np.repeat(np.arange(480) % 24, 4)
    samples = Samples(
        **{name: getattr(samples, name) for name in Samples.__slots__} | {"t_s": one_hour}
    )
    parts = parts_of(samples, Data(epochs=1), 1, rng=np.random.default_rng(3))
    assert not parts.unused
    assert len(parts.train) == pytest.approx(0.7 * 1920, rel=0.05, abs=0)


def test_a_part_without_rows_is_an_error():
    with pytest.raises(BadInputError, match="no epoch is left for validation"):
        parts_of(days(runs=1, length=4), Data(epochs=1), 1, rng=np.random.default_rng(3))


def test_shares_must_add_up():
    with pytest.raises(ValueError, match="shares: must add up to 1"):
        Data(epochs=1, shares=(0.5, 0.2, 0.2))


def test_windows_end_with_their_own_row_and_stay_in_their_run():
    rows = Rows(days(runs=2, length=4), np.array([0]), 3, "cpu")
    seen, _, _ = rows(rows.on_device(np.array([2, 7])))
    np.testing.assert_array_equal(seen[:, :, 0].numpy(), [[0, 1, 2], [5, 6, 7]])
    with pytest.raises(BadInputError, match=r"window 3: reaches before its run's start, .* row 5"):
        rows.on_device(np.array([2, 5]))


def test_every_row_comes_once_per_pass_in_an_order_of_its_own():
    rows = Rows(days(runs=2), np.array([0]), 3, "cpu")
    of = np.arange(10, 33)
    batches = Shuffled(rows, of, 7, seed=1)
    passes = [
        np.concatenate([batches(4 * k + i)[0][:, -1, 0].numpy() for i in range(4)]) for k in (0, 1)
    ]
    for seen in passes:
        np.testing.assert_array_equal(np.sort(seen), of)
    assert not np.array_equal(*passes)
    fresh = Shuffled(rows, of, 7, seed=1)(5)[0]
    np.testing.assert_array_equal(fresh.numpy(), batches(5)[0].numpy())
    np.testing.assert_array_equal(np.diff(fresh.numpy()[:, :, 0], axis=1), 1.0)

"""Paired block bootstrap: blocks by hand, pairing, coverage on known data."""

import numpy as np
import pytest

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval, time_blocks

S = 1_000_000_000


def stamps(n: int, period_s: float = 0.1) -> np.ndarray:
    return 5 * S + np.round(np.arange(n) * period_s * 1e9).astype(np.int64)


@pytest.mark.parametrize(
    ("n", "period_s", "sizes"),
    [
        (0, 0.1, []),
        (1, 0.1, [1]),
        (30, 0.1, [30]),  # 3 s: one block
        (99, 0.1, [99]),  # 9.9 s: the rest of 4.9 s joins the first block
        (100, 0.1, [50, 50]),
        (149, 0.1, [50, 99]),
        (150, 0.1, [50, 50, 50]),
        (30, 1.0, [5, 5, 5, 5, 5, 5]),  # every tenth frame
        (4, 6.0, [1, 1, 1, 1]),
    ],
)
def test_blocks_equal_those_found_by_hand(n, period_s, sizes):
    blocks = time_blocks(stamps(n, period_s))
    assert [len(b) for b in blocks] == sizes
    assert np.concatenate([*blocks, np.zeros(0, int)]).tolist() == list(range(n))


def test_a_gap_in_time_ends_a_block():
    two_parts = np.concatenate([stamps(60), stamps(60) + 100 * S])
    assert [len(b) for b in time_blocks(two_parts)] == [50, 10, 60]


def test_fewer_than_two_blocks_give_no_interval():
    few = BlockBootstrap.of(stamps(30), 100, np.random.default_rng(0))
    assert few.n_blocks == 1
    assert percentile_interval(few.samples(lambda times: times.sum(axis=1))) is None


def test_whole_blocks_are_drawn_together():
    drawn = BlockBootstrap.of(stamps(150), 200, np.random.default_rng(0))
    assert drawn.n_blocks == 3
    assert drawn.weights.shape == (200, 150)
    per_block = drawn.weights.reshape(200, 3, 50)
    assert (per_block == per_block[:, :, :1]).all()
    assert (per_block[:, :, 0].sum(axis=1) == 3).all()
    assert len(np.unique(per_block[:, :, 0], axis=0)) == 10  # all 10 multisets of 3 out of 3 turn up


def test_same_seed_same_draws():
    a, b, c = (BlockBootstrap.of(stamps(200), 50, np.random.default_rng(s)).weights for s in (1, 1, 2))
    assert (a == b).all()
    assert (a != c).any()


def test_pairing_cancels_common_variation_of_frames():
    rng = np.random.default_rng(0)
    clean = rng.normal(size=500)  # varies wildly from frame to frame
    attacked = clean - 0.3  # but the attack always costs the same
    drawn = BlockBootstrap.of(stamps(500), 300, rng)
    loss = drawn.weights @ (attacked - clean) / drawn.weights.sum(axis=1)
    low, high = percentile_interval(loss)
    assert low == pytest.approx(-0.3)
    assert high == pytest.approx(-0.3)


def test_the_interval_covers_the_true_mean_about_as_often_as_stated():
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(200):
        per_block = rng.normal(size=40)
        values = np.repeat(per_block, 5)  # frames of a block are copies: worst case of dependence
        drawn = BlockBootstrap.of(stamps(200, 1.0), 200, rng)
        low, high = percentile_interval(drawn.weights @ values / drawn.weights.sum(axis=1))
        covered += low <= 0 <= high
    assert 0.88 <= covered / 200 <= 0.99


def test_samples_follow_the_draws_and_equal_draws_are_computed_once():
    drawn = BlockBootstrap.of(stamps(150), 200, np.random.default_rng(0))
    values = np.random.default_rng(1).normal(size=150)
    computed = []

    def mean(times):
        computed.append(len(times))
        weights = times[:, drawn.block]
        return weights @ values / weights.sum(axis=1)

    assert drawn.samples(mean) == pytest.approx(drawn.weights @ values / drawn.weights.sum(axis=1))
    assert computed == [10]  # all multisets of 3 blocks out of 3


def test_undefined_draws_are_left_out():
    assert percentile_interval(np.array([np.nan, 1.0, np.inf, 3.0]), level=0.5) == (1.5, 2.5)
    assert percentile_interval(np.array([np.nan])) is None

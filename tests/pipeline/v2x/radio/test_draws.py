import numpy as np
import pytest
from scipy.stats import kstest

from advpipe.pipeline.v2x.radio.draws import GOLDEN, Draws, message_keys, mix

REFERENCE = (
    6457827717110365317,
    3203168211198807973,
    9817491932198370423,
    4593380528125082431,
    16408922859458223821,
)
"""The first numbers of SplitMix64 from the seed 1234567, as its reference program prints them."""


@pytest.mark.oracle
def test_the_generator_is_splitmix64() -> None:
    states = np.uint64(1234567) + GOLDEN * np.arange(1, 6, dtype=np.uint64)
    assert mix(states).tolist() == list(REFERENCE)


def test_draws_are_uniform_and_independent() -> None:
    keys, receivers = message_keys(np.arange(300), 10**9), np.arange(300, dtype=np.uint64)
    drawn = Draws(1).of_pairs("fading", keys[:, None], receivers[None])
    assert kstest(drawn.ravel(), "uniform").pvalue > 0.01
    other_use = Draws(1).of_pairs("errors", keys[:, None], receivers[None])
    other_seed = Draws(2).of_pairs("fading", keys[:, None], receivers[None])
    bound = 4 / np.sqrt(drawn.size)  # four standard deviations of a correlation
    for other in (drawn.T, np.roll(drawn, 1, 0), np.roll(drawn, 1, 1), other_use, other_seed):
        assert abs(np.corrcoef(drawn.ravel(), other.ravel())[0, 1]) < bound


def test_a_draw_depends_only_on_its_message_and_receiver() -> None:
    keys, receivers = message_keys(np.arange(5), 7), np.arange(9, dtype=np.uint64)
    together = Draws(3).of_pairs("fading", keys[:, None], receivers[None])
    assert Draws(3).of_pairs("fading", keys[2:3], receivers[4:5])[0] == together[2, 4]
    rows, columns = np.array([2, 0, 2]), np.array([4, 8, 0])
    some = Draws(3).of_some_pairs("fading", keys, receivers, rows, columns)
    assert (some == together[rows, columns]).all()


def test_keys_distinguish_station_time_and_copy() -> None:
    stations, times_ns, copies = np.meshgrid(np.arange(20), np.arange(20) * 10**8, np.arange(3))
    assert len(np.unique(message_keys(stations, times_ns, copies))) == 1200


def test_a_key_is_the_same_in_a_batch_or_alone() -> None:
    assert message_keys(5, 7) == message_keys(np.array([4, 5]), 7)[1]

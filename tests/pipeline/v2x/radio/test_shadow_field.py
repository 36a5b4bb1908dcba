"""The correlated field against Gudmundson's exponential, and that the medium uses it."""

import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.medium import Medium
from advpipe.pipeline.v2x.radio.shadow_field import ShadowField
from advpipe.pipeline.v2x.radio.stations import Stations, Transmissions
from advpipe.pipeline.v2x.section import Radio, Shadowing

CORRELATION_M = 20.0
FAR_M = np.array([5000.0, 300.0])


def autocorrelation(moved_m: float, *, both: bool = False, fields: int = 60) -> float:
    """The mean product of the shadowing of links before and after their first end, or both, moved east."""
    products, rng = [], np.random.default_rng(3)
    for seed in range(fields):
        field = ShadowField(CORRELATION_M, np.random.default_rng(seed))
        first_m = rng.uniform(0, 2000, (60, 2))
        shift_m = np.array([moved_m, 0.0])
        places_m = np.concatenate([first_m, first_m + shift_m, [FAR_M, FAR_M + shift_m]])
        value = field.normal(places_m)
        products.append(value[:60, -2] * value[60:120, -1 if both else -2])
    return float(np.mean(products))


def test_variance_is_one_and_links_are_reciprocal() -> None:
    assert autocorrelation(0.0) == pytest.approx(1.0, abs=0.05)
    places_m = np.random.default_rng(1).uniform(0, 500, (30, 2))
    value = ShadowField(CORRELATION_M, np.random.default_rng(1)).normal(places_m)
    np.testing.assert_allclose(value, value.T, atol=1e-12)


@pytest.mark.parametrize("moved_m", [5.0, 10.0, 20.0, 40.0])
def test_autocorrelation_falls_exponentially_with_the_distance_that_one_end_moves(moved_m: float) -> None:
    assert autocorrelation(moved_m) == pytest.approx(np.exp(-moved_m / CORRELATION_M), abs=0.05)


def test_both_ends_moving_count_with_the_sum_of_their_ways() -> None:
    assert autocorrelation(10.0, both=True) == pytest.approx(np.exp(-20 / CORRELATION_M), abs=0.05)


def test_values_are_normal() -> None:
    values = np.concatenate(
        [
            ShadowField(CORRELATION_M, np.random.default_rng(seed)).normal(
                np.random.default_rng(seed).uniform(0, 5000, (20, 2))
            )[np.triu_indices(20, 1)]
            for seed in range(100)
        ]
    )
    assert np.mean(values) == pytest.approx(0, abs=0.05)
    assert np.std(values) == pytest.approx(1, abs=0.03)
    assert np.mean(np.abs(values) < 1) == pytest.approx(0.683, abs=0.02)
    assert np.mean(np.abs(values) < 2) == pytest.approx(0.954, abs=0.01)


def received_dbm(radio: Radio, times_ns: list[int], seed: int = 1) -> np.ndarray:
    """The power of one station's messages at another, both standing still."""
    places_m = np.array([[0.0, 0.0, 1.5], [80.0, 0.0, 1.5]])
    stations, found = Stations(np.array([1, 2]), places_m), []
    medium = Medium(radio, seed)
    for number, time_ns in enumerate(times_ns):
        at = np.array([time_ns])
        keys = message_keys(np.array([1]), at)
        message = Transmissions(np.array([number]), keys, np.array([1]), at, np.array([100]))
        outcomes = medium.advance(time_ns + 10_000_000, stations, message).outcomes
        found += outcomes.power_dbm[:, 1].tolist()
    return np.array(found)


def test_standing_vehicles_keep_their_shadowing() -> None:
    times_ns = [step * 100_000_000 for step in range(20)]
    fixed = Radio(fading="none", shadowing=Shadowing(correlation_distance_m=CORRELATION_M))
    drawn_anew = Radio(fading="none")
    assert np.ptp(received_dbm(fixed, times_ns)) == 0.0
    assert np.std(received_dbm(drawn_anew, times_ns)) > 3
    many = [received_dbm(fixed, times_ns[:1], seed)[0] for seed in range(200)]
    assert np.std(many) == pytest.approx(5.6, rel=0.15)

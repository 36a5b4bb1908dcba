import numpy as np
import pytest

from advpipe.pipeline.v2x.radio.error_rate import (
    HALF,
    MODULATIONS,
    THREE_QUARTERS,
    TWO_THIRDS,
    Code,
    error_free_snr_db,
    is_lost,
    success_rate,
)

PUNCTURING = {HALF: ((1,), (1,)), TWO_THIRDS: ((1, 1), (1, 0)), THREE_QUARTERS: ((1, 1, 0), (1, 0, 1))}
"""Which bits of the two generators' are sent (IEEE 802.11-2016, 17.3.5.6)."""


@pytest.mark.parametrize(
    ("octets", "snr_db"), [(350, (5.66, 6.01, 6.56, 7.22)), (200, (5.50, 5.84, 6.39, 7.06))]
)
def test_six_mbps_agrees_with_other_simulators(octets: int, snr_db: tuple[float, ...]) -> None:
    rates = success_rate(np.array(snr_db), 8 * octets, 6.0)
    np.testing.assert_allclose(rates, [0.1, 0.5, 0.9, 0.99], atol=0.012)


def weights(code: Code, count: int) -> list[int]:
    """Information errors of the paths that leave the zero state and return, by distance, from the trellis."""
    patterns, period = PUNCTURING[code], code.bits
    limit = code.distances[count - 1]
    total = np.zeros(limit + 1, np.int64)
    for phase in range(period):
        paths = {0: (np.eye(1, limit + 1, dtype=np.int64)[0], np.zeros(limit + 1, np.int64))}
        step = phase
        while paths:
            onward: dict[int, tuple[np.ndarray, np.ndarray]] = {}
            for state, (number, errors) in paths.items():
                for bit in (1,) if step == phase else (0, 1):
                    register = bit << 6 | state
                    distance = sum(
                        (register & generator).bit_count() % 2 * pattern[step % period]
                        for generator, pattern in zip((0o133, 0o171), patterns, strict=True)
                    )
                    moved = [np.concatenate([np.zeros(distance, np.int64), row])[: limit + 1] for row in (
                        number, errors + bit * number
                    )]  # fmt: skip
                    if register >> 1 == 0:
                        total += moved[1]
                    elif moved[0].any():
                        known = onward.get(register >> 1, (0, 0))
                        onward[register >> 1] = (known[0] + moved[0], known[1] + moved[1])
            paths, step = onward, step + 1
    return [int(total[distance]) for distance in code.distances[:count]]


@pytest.mark.oracle
@pytest.mark.parametrize("code", [HALF, TWO_THIRDS, THREE_QUARTERS], ids=["1/2", "2/3", "3/4"])
def test_the_spectra_equal_those_of_the_codes(code: Code) -> None:
    assert weights(code, len(code.weights)) == list(code.weights)


@pytest.mark.parametrize("rate", MODULATIONS)
def test_success_rises_from_zero_to_one(rate: float) -> None:
    rates = success_rate(np.linspace(-20, 45, 400), 8 * 300, rate)
    assert (np.diff(rates) >= -1e-12).all()
    assert rates[0] == 0
    assert rates[-1] == 1


@pytest.mark.parametrize("rate", MODULATIONS)
def test_the_error_free_ratio_has_certain_success(rate: float) -> None:
    """Above it, the longest frame of 4095 bytes has a chance of one to the last bit; a little below, not."""
    sure_db = error_free_snr_db(rate)
    assert (success_rate(np.linspace(sure_db, 200, 5000), 8 * 4095, rate) == 1.0).all()
    assert success_rate(np.array(sure_db - 3), 8 * 4095, rate) < 1.0


def test_faster_bitrates_need_a_higher_ratio() -> None:
    needed_db = [
        np.interp(0.5, success_rate(g := np.linspace(-5, 30, 2000), 2800, r), g) for r in MODULATIONS
    ]
    assert needed_db[2] == pytest.approx(needed_db[0] + 3.01, abs=0.02)  # QPSK against BPSK
    assert (np.diff(np.delete(needed_db, 1)) > 0).all()  # BPSK 3/4 needs about what QPSK 1/2 does


@pytest.mark.parametrize("rate", MODULATIONS)
def test_who_is_lost_is_decided_as_by_the_rate_itself(rate: float) -> None:
    """Also next to the rate, where the table cannot decide, and beyond the table at both of its ends."""
    rng = np.random.default_rng(3)
    snr_db = np.concatenate([rng.uniform(-40, 70, 20_000), rng.uniform(0, 30, 20_000)])
    bits = rng.integers(8 * 80, 8 * 2000, len(snr_db))
    chance = success_rate(snr_db, bits, rate)
    random = rng.uniform(2.0**-54, 1, len(snr_db))
    near = np.clip(chance * (1 + rng.choice([-1e-12, 0, 1e-12], len(snr_db))), 2.0**-54, 1 - 2.0**-53)
    for luck in (random, near, np.nextafter(near, 0), np.nextafter(near, 1)):
        np.testing.assert_array_equal(is_lost(luck, snr_db, bits, rate), luck > chance)
        assert 0 < is_lost(luck, snr_db, bits, rate).sum() < len(luck)


def test_no_messages_are_lost_where_there_are_none() -> None:
    nothing = np.empty(0)
    assert is_lost(nothing, nothing, nothing.astype(np.int64), 6.0).shape == (0,)

import pytest

from advpipe.pipeline.v2x.radio.ofdm import Ofdm
from advpipe.pipeline.v2x.section import Radio


@pytest.mark.parametrize(("cam_bytes", "air_time_us"), [(41, 208), (241, 480)])
def test_air_time_agrees_with_artery(cam_bytes: int, air_time_us: int) -> None:
    """Artery's shortest delays are 210 and 482 us for these, with 2 us of propagation."""
    assert Ofdm(Radio()).air_time_ns(cam_bytes) == air_time_us * 1000


def test_air_time_equals_values_computed_by_hand() -> None:
    """100 bytes and 22 bits are 822 bits: 9 symbols of 96 bits; 5 symbols before them."""
    ofdm = Ofdm(Radio(bitrate_mbps=12, overhead_bytes=0))
    assert ofdm.air_time_ns(100) == (5 + 9) * 8_000
    assert Ofdm(Radio(bitrate_mbps=24, bandwidth_mhz=20, overhead_bytes=0)).air_time_ns(100) == 14 * 4_000


def test_the_aifs_is_that_of_best_effort() -> None:
    ofdm = Ofdm(Radio())
    assert (ofdm.slot_ns, ofdm.aifs_ns) == (13_000, 110_000)

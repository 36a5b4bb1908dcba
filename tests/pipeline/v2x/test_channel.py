"""The channel: the outcomes of valid messages, of corrupt ones, and of those whose listener has left."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.ldm import ldm_detections_cdr, ldm_snapshot_cdr
from advpipe.pipeline.messages.v2x import received_messages
from advpipe.pipeline.v2x.channel import Channel, ChannelResult, Sent
from advpipe.pipeline.v2x.facilities.cam import cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.pipeline.v2x.facilities.ldm import Verdict
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.stations import Stations
from advpipe.pipeline.v2x.section import Radio, V2x

START_NS = 1_767_268_800_000_000_000
MS = 1_000_000
SENDER, EGO, OTHER = 11, 22, 33
GEODESY = Geodesy(48.0, 11.0, 500.0)
PLAIN = {"path_loss": "free_space", "shadowing": None, "fading": "none"}
NEAR = Stations(np.array([SENDER, EGO, OTHER]), np.array([[0.0, 0, 1.5], [40, 0, 1.5], [0, 60, 1.5]]))


def channel(**radio: object) -> Channel:
    return Channel(V2x(radio=Radio(**(PLAIN | radio))), 1, GEODESY, {EGO: "ego", OTHER: "other"})  # type: ignore[arg-type]


def message(number: int, at_ms: float, payload: bytes) -> Sent:
    request_ns = START_NS + round(at_ms * MS)
    return Sent(number, int(message_keys(SENDER, request_ns)), SENDER, request_ns, payload, 23.0)


@pytest.fixture
def payload(car: Callable[..., StationState]) -> bytes:
    return encode_cam(cam_of_state(car(time_ns=START_NS, heading_rad=math.pi / 2, speed_mps=10.0)))


def arrivals(heard: ChannelResult) -> list[tuple[str, int, Verdict]]:
    return [(one.listener, one.sent.number, one.verdict) for one in heard.received]


def test_a_cam_reaches_both_listeners_and_enters_their_maps(payload: bytes) -> None:
    one = channel()
    heard = one.advance(START_NS + 100 * MS, NEAR, [message(0, 10, payload)])
    assert arrivals(heard) == [("ego", 0, Verdict.ACCEPTED), ("other", 0, Verdict.ACCEPTED)]
    # 65 bytes and 82 around them at 6 Mbit/s, with preamble: a quarter of a millisecond.
    assert heard.received[0].arrival_ns - START_NS == pytest.approx(10.3 * MS, abs=0.1 * MS)
    (entry,) = one.snapshot("ego", START_NS + 100 * MS).entries
    assert entry.report.station_id == 7  # as it claims, whatever radio sent it
    assert entry.report.front_m == pytest.approx((0, 0, 0), abs=0.01)
    assert (entry.report.yaw_rad, entry.report.speed_mps) == (pytest.approx(0, abs=1e-6), 10.0)


def test_corrupt_bytes_are_counted_and_never_in_a_map(payload: bytes) -> None:
    broken = [b"", b"\x00", payload[:20], payload + b"\x00", b"\x02\x01" + payload[2:], b"\xff" * 300]
    one = channel()
    sent = [message(number, 10 + 5 * number, data) for number, data in enumerate(broken)]
    heard = one.advance(START_NS + 100 * MS, NEAR, sent)
    assert {verdict for _, _, verdict in arrivals(heard)} == {Verdict.CORRUPT}
    assert [one.sent.payload for one in heard.received if one.listener == "ego"] == broken
    assert all(one.tree is None for one in heard.received)
    snapshot = one.snapshot("ego", START_NS + 100 * MS)
    assert (snapshot.verdicts[Verdict.CORRUPT], snapshot.entries) == (len(broken), ())


def test_flipped_bits_never_raise_an_error(payload: bytes) -> None:
    """Every message has a verdict, whatever its bits; a message that is still a CAM may hold any values."""
    rng, one, sent = np.random.default_rng(3), channel(), []
    for number in range(600):
        data = bytearray(payload)
        for _ in range(int(rng.integers(1, 9))):
            data[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        sent.append(message(number, 1.5 * number, bytes(data)))
    heard = one.advance(START_NS + 1000 * MS, NEAR, sent)
    written = [list(received_messages(received)) for received in heard.received]
    assert {len(messages) for messages in written} == {3, 4}  # as values, too, where there are any
    snapshot = one.snapshot("ego", START_NS + 1000 * MS)
    assert sum(snapshot.verdicts.values()) == len(sent)
    assert min(snapshot.verdicts[Verdict.CORRUPT], snapshot.verdicts[Verdict.ACCEPTED]) > 50
    assert ldm_snapshot_cdr(snapshot)
    assert ldm_detections_cdr(snapshot)


def test_a_message_in_processing_arrives_in_a_later_step(payload: bytes) -> None:
    one = channel(processing_delay_min_s=0.15, processing_delay_max_s=0.15)
    assert not one.advance(START_NS + 100 * MS, NEAR, [message(0, 10, payload)]).received
    heard = one.advance(START_NS + 200 * MS, NEAR, [])
    assert arrivals(heard) == [("ego", 0, Verdict.ACCEPTED), ("other", 0, Verdict.ACCEPTED)]
    assert not one.advance(START_NS + 300 * MS, NEAR, []).received


def test_a_listener_that_left_receives_nothing(payload: bytes) -> None:
    one = channel(processing_delay_min_s=0.15, processing_delay_max_s=0.15)
    one.advance(START_NS + 100 * MS, NEAR, [message(0, 10, payload)])
    without_ego = Stations(NEAR.ids[[0, 2]], NEAR.antenna_m[[0, 2]])
    assert arrivals(one.advance(START_NS + 200 * MS, without_ego, [])) == [("other", 0, Verdict.ACCEPTED)]
    assert not one.advance(START_NS + 300 * MS, NEAR, []).received


def test_the_end_of_a_drive_waits_for_every_message(payload: bytes) -> None:
    """One is on the air at the end, and one waits for the channel behind it: both arrive, and count."""
    one = channel(processing_delay_min_s=0.15, processing_delay_max_s=0.15)
    sent = [message(0, 99.8, payload), message(1, 99.9, payload)]
    assert not one.advance(START_NS + 100 * MS, NEAR, sent).received
    before = one.statistics()
    heard = one.finish(START_NS + 100 * MS, NEAR)
    assert [number for listener, number, _ in arrivals(heard) if listener == "ego"] == [0, 1]
    statistics = one.statistics()
    assert (statistics.cams, statistics.outcomes["received"]) == (2, 4)
    assert statistics.busy_ns == before.busy_ns  # the silence at the end is no load
    assert one.finish(START_NS + 100 * MS, NEAR) == ChannelResult()


def test_a_sender_that_leaves_takes_its_queue_with_it(payload: bytes) -> None:
    one = channel()
    sent = [message(0, 99.8, payload), message(1, 99.9, payload)]
    one.advance(START_NS + 100 * MS, NEAR, sent)
    heard = one.finish(START_NS + 100 * MS, Stations(NEAR.ids[1:], NEAR.antenna_m[1:]))
    assert {number for _, number, _ in arrivals(heard)} == {0}
    assert one.statistics().dropped == 1

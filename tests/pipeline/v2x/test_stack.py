"""From CAM to packet and back, and what the channel makes of packets."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("cryptography")

from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.channel import Channel, ChannelResult, Sent
from advpipe.pipeline.v2x.facilities.cam import cam_of_state
from advpipe.pipeline.v2x.facilities.cam_tree import encode_cam
from advpipe.pipeline.v2x.facilities.station_state import StationState
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.radio.stations import Stations
from advpipe.pipeline.v2x.section import Radio, SecurityRules, V2x
from advpipe.pipeline.v2x.security.verifier import Rejection
from advpipe.pipeline.v2x.stack import PacketBuilder, ReceiverStack, mac_address

START_NS = 1_767_268_800_000_000_000
MS = 1_000_000
SENDER, EGO = 11, 22
NEAR = Stations(np.array([SENDER, EGO]), np.array([[0.0, 0, 1.5], [40, 0, 1.5]]))


@pytest.fixture
def payload(car: Callable[..., StationState]) -> bytes:
    return encode_cam(cam_of_state(car(time_ns=START_NS, speed_mps=10.0)))


def v2x(security: str = "etsi", overhead_bytes: int = 82, **rules: float) -> V2x:
    radio = Radio(path_loss="free_space", shadowing=None, fading="none", overhead_bytes=overhead_bytes)
    return V2x(
        radio=radio,
        geonetworking=True,
        security=security,  # type: ignore[arg-type]
        security_rules=SecurityRules(**rules),  # type: ignore[arg-type]
    )


def channel(section: V2x) -> Channel:
    stack = ReceiverStack(section, 1, START_NS)
    return Channel(section, 1, Geodesy(48.0, 11.0, 500.0), {EGO: "ego"}, stack=stack)


def message(number: int, at_ms: float, payload: bytes, packet: bytes) -> Sent:
    at_ns = START_NS + round(at_ms * MS)
    return Sent(number, int(message_keys(SENDER, at_ns)), SENDER, at_ns, payload, 23.0, packet)


def sent(section: V2x, payload: bytes, *packets: bytes) -> ChannelResult:
    """One message each 20 ms, with its own packet if none is given."""
    builder = PacketBuilder(section, 1, START_NS)
    own = packets or (builder.packet(SENDER, START_NS, payload),)
    messages = [message(index, 20 * index, payload, packet) for index, packet in enumerate(own)]
    return channel(section).advance(START_NS + 500 * MS, NEAR, messages)


def test_a_signed_cam_reaches_the_map(payload: bytes) -> None:
    result = sent(v2x(), payload)
    assert [one.sent.payload for one in result.received] == [payload]
    assert result.rejected == ()


def test_air_time_is_that_of_the_packet(payload: bytes) -> None:
    """Without security a packet is as long as `overhead_bytes` says, whose default it does not need."""
    bare = Channel(V2x(radio=v2x().radio), 1, Geodesy(48.0, 11.0, 500.0), {EGO: "ego"})
    plain = bare.advance(START_NS + 500 * MS, NEAR, [message(0, 0, payload, b"")])
    arrivals = [
        result.received[0].arrival_ns
        for result in (plain, sent(v2x("none"), payload), sent(v2x("none", 0), payload), sent(v2x(), payload))
    ]
    assert arrivals[0] == arrivals[1] == arrivals[2]
    assert arrivals[3] - arrivals[0] == pytest.approx(225 * 8 / 6e6 * 1e9, abs=8_000)  # with the certificate


def test_the_map_does_not_see_what_is_rejected(payload: bytes) -> None:
    section, one = v2x(), channel(v2x())
    builder = PacketBuilder(section, 1, START_NS)
    genuine = builder.packet(SENDER, START_NS, payload)
    packets = [
        builder.packet(SENDER, START_NS, payload, is_signed=False),
        genuine[:60],
        b"",
        genuine,
        genuine,
    ]
    messages = [message(index, 20 * index, payload, packet) for index, packet in enumerate(packets)]
    later = builder.packet(SENDER, START_NS + 100 * MS, payload)
    messages.append(message(5, 100, payload[:-1] + b"\xff", later))
    result = one.advance(START_NS + 500 * MS, NEAR, messages)
    assert [received.sent.number for received in result.received] == [3]
    assert [(rejected.sent.number, rejected.rejection) for rejected in result.rejected] == [
        (0, Rejection.UNSIGNED),
        (1, Rejection.MALFORMED),
        (2, Rejection.MALFORMED),
        (4, Rejection.REPLAYED),
        (5, Rejection.MALFORMED),  # its packet holds another CAM
    ]
    snapshot = one.snapshot("ego", START_NS + 500 * MS)
    assert sum(snapshot.verdicts.values()) == 1
    assert one.statistics().cams == len(messages)


def test_verification_delays_the_map(payload: bytes) -> None:
    """A message that is still verified at the end of a step belongs to a later one."""
    at_once, section = sent(v2x(), payload), v2x(verification_time_s=0.15)
    one, packet = channel(section), PacketBuilder(section, 1, START_NS).packet(SENDER, START_NS, payload)
    first = one.advance(START_NS + 200 * MS, NEAR, [message(0, 0, payload, packet)])
    second = one.finish(START_NS + 200 * MS, NEAR)
    assert (first.received, len(second.received)) == ((), 1)
    late_ns = second.received[0].arrival_ns - at_once.received[0].arrival_ns
    assert late_ns == 300 * MS  # the ticket's signature and the message's


def test_addresses_belong_to_station_ids() -> None:
    macs = {mac_address(seed, number) for seed in (1, 2) for number in range(50)}
    assert len(macs) == 100
    assert all(mac[0] & 0x03 == 0x02 for mac in macs)  # locally administered, of one station


def test_unused_sections_are_not_recorded() -> None:
    """A drive without packets is recorded as before there were any."""
    assert not {"geonetworking", "security", "security_rules"} & V2x().model_dump().keys()
    used = V2x(security="etsi", security_rules=SecurityRules(max_age_s=1.0))
    assert V2x(**used.model_dump()) == used


def test_packets_that_are_cut_off_are_kept_and_counted(payload: bytes) -> None:
    whole = PacketBuilder(v2x(), 1, START_NS).packet(SENDER, START_NS, payload)
    faulty = PacketBuilder(v2x(truncated_share=1.0), 1, START_NS)
    cut = faulty.packet(SENDER, START_NS, payload)
    assert 0 < len(cut) < len(whole)
    assert whole.startswith(cut)
    air = channel(v2x())
    result = air.advance(START_NS + 500 * MS, NEAR, [message(0, 0, payload, cut)])
    assert [(one.rejection, one.sent.packet) for one in result.rejected] == [(Rejection.MALFORMED, cut)]
    assert ("messages rejected", "1 malformed") in air.statistics().lines()

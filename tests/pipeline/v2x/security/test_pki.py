"""Faults of an honest fleet's tickets, authority and clocks: what a receiver makes of its messages."""

from __future__ import annotations

import pytest

from advpipe.pipeline.v2x.clock import clock_error_ns
from advpipe.pipeline.v2x.section import SecurityRules, V2x
from advpipe.pipeline.v2x.security.verifier import Rejection
from advpipe.pipeline.v2x.stack import PacketBuilder, ReceiverStack

START_NS, SEED = 1_767_268_800_000_000_000, 1


def delivered(payload: bytes, v2x: V2x, stations: int = 40) -> list[Rejection | None]:
    """What becomes of one message of each of these stations."""
    builder, stack = PacketBuilder(v2x, SEED, START_NS), ReceiverStack(v2x, SEED, START_NS)
    packets = [builder.packet(station, START_NS, payload) for station in range(1, stations + 1)]
    return [stack.deliver("ego", packet, START_NS + 1_000_000).rejection for packet in packets]


@pytest.mark.parametrize(
    ("rules", "reason"),
    [
        ({"expired_share": 0.5}, Rejection.EXPIRED_TICKET),
        ({"unpermitted_share": 0.5}, Rejection.NOT_PERMITTED),
    ],
)
def test_a_share_of_the_stations_has_a_faulty_ticket(
    payload: bytes, rules: dict[str, float], reason: Rejection
) -> None:
    found = delivered(payload, V2x(security="etsi", security_rules=SecurityRules(**rules)))  # type: ignore[arg-type]
    assert set(found) == {None, reason}
    assert 10 <= found.count(reason) <= 30


def test_nobody_is_believed_whose_authority_has_expired(payload: bytes) -> None:
    rules = SecurityRules(expired_authority=True)
    found = delivered(payload, V2x(security="etsi", security_rules=rules), 3)
    assert found == [Rejection.EXPIRED_AUTHORITY] * 3


def test_clocks_that_disagree_are_counted(payload: bytes) -> None:
    v2x = V2x(security="etsi", clock_error_s=3.0)
    found = delivered(payload, v2x)
    errors_ns = [clock_error_ns(v2x, SEED, station) for station in range(1, 41)]
    for reason, error_ns in zip(found, errors_ns, strict=True):
        if error_ns > 200_000_000:
            assert reason is Rejection.FUTURE
        elif error_ns < -2_000_000_000:
            assert reason is Rejection.STALE
        else:
            assert reason is None
    assert {Rejection.FUTURE, Rejection.STALE, None} == set(found)


@pytest.mark.parametrize("with_security", [True, False])
def test_truncated_packets_are_counted_and_not_read(payload: bytes, with_security: bool) -> None:
    v2x = V2x(security="etsi" if with_security else "none", geonetworking=True)
    packet = PacketBuilder(v2x, SEED, START_NS).packet(1, START_NS, payload)
    stack = ReceiverStack(v2x, SEED, START_NS)
    found = {stack.deliver("ego", packet[:size], START_NS).rejection for size in range(len(packet))}
    assert found == {Rejection.MALFORMED}

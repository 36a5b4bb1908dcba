"""What a receiver's security entity rejects, and the time that its verification takes."""

from __future__ import annotations

import pytest

from advpipe.pipeline.v2x.geonetworking.packet import geonetworking_packet
from advpipe.pipeline.v2x.section import SecurityRules, V2x
from advpipe.pipeline.v2x.security.envelope import sign_envelope
from advpipe.pipeline.v2x.security.keys import SigningKey
from advpipe.pipeline.v2x.security.pki import Holder, Pki
from advpipe.pipeline.v2x.security.verifier import MessageVerifier, Rejection, SignatureChecks
from advpipe.pipeline.v2x.stack import PacketBuilder

START_NS = 1_767_268_800_000_000_000
MS = 1_000_000


def verifier(pki: Pki, **rules: float) -> MessageVerifier:
    return MessageVerifier(SecurityRules(**rules), SignatureChecks(pki.authority))  # type: ignore[arg-type]


def signed(
    holder: Holder, at_ns: int = START_NS, with_certificate: bool = True, content: bytes = b"x"
) -> bytes:
    envelope = sign_envelope(content, at_ns, *holder, with_certificate)
    return geonetworking_packet(envelope.encode(), is_secured=True)


def test_a_signed_message_is_accepted_and_then_its_digest_suffices(pki: Pki) -> None:
    one, car = verifier(pki), pki.ticket("car")
    later_ns = START_NS + 300 * MS
    assert one.verify(signed(car, with_certificate=False), START_NS).rejection is Rejection.UNKNOWN_SIGNER
    assert one.verify(signed(car), START_NS) == (b"x", None, START_NS)
    assert one.verify(signed(car, later_ns, with_certificate=False), later_ns).content == b"x"
    assert verifier(pki).verify(signed(car, later_ns, False), later_ns).rejection is Rejection.UNKNOWN_SIGNER


@pytest.mark.parametrize(
    ("late_ms", "rejection"),
    [(-201, Rejection.FUTURE), (-199, None), (1999, None), (2001, Rejection.STALE)],
)
def test_a_message_is_accepted_around_its_time(pki: Pki, late_ms: int, rejection: Rejection | None) -> None:
    assert verifier(pki).verify(signed(pki.ticket("car")), START_NS + late_ms * MS).rejection is rejection


def test_outsiders_are_rejected(pki: Pki) -> None:
    one, (ticket, key) = verifier(pki), pki.ticket("car")
    other = SigningKey(1, "outsider")
    outside = Pki(1, START_NS, "outsider").ticket("car")
    old = pki.ticket("old", start_s=pki.start_s - 7200, hours=1)
    cases = {
        Rejection.WRONG_SIGNATURE: signed((ticket, other)),
        Rejection.UNTRUSTED: signed(outside),
        Rejection.EXPIRED_TICKET: signed(old),
        Rejection.NOT_PERMITTED: signed(pki.ticket("car", permissions={37: b"\x01\0\0\0"})),
        Rejection.UNSIGNED: geonetworking_packet(b"x" * 40),
        Rejection.MALFORMED: signed((ticket, key))[:-1],
    }
    assert {one.verify(packet, START_NS).rejection: packet for packet in cases.values()} == cases
    assert one.verify(signed((ticket, key)), START_NS).rejection is None  # none of them did harm


def test_a_replayed_message_is_rejected_until_its_age_rejects_it(pki: Pki) -> None:
    one, packet = verifier(pki), signed(pki.ticket("car"))
    found = [one.verify(packet, START_NS + late_ms * MS).rejection for late_ms in (0, 1, 1999, 2001)]
    assert found == [None, Rejection.REPLAYED, Rejection.REPLAYED, Rejection.STALE]


def test_a_forged_message_does_not_block_the_true_one(pki: Pki) -> None:
    """A forger who knows the true signature cannot make the receiver take the true message for a replay."""
    one, car = verifier(pki), pki.ticket("car")
    true = signed(car)
    forged = true.replace(b"x", b"y", 1)
    assert one.verify(forged, START_NS).rejection is not None
    assert one.verify(true, START_NS).rejection is None


def test_verification_takes_time_and_its_queue_is_finite(pki: Pki) -> None:
    one = verifier(pki, verification_time_s=0.010, verification_queue=2)
    cars = [pki.ticket(number) for number in range(4)]
    results = [one.verify(signed(car), START_NS) for car in cars]
    # Of a new ticket, two signatures: one is verified, two wait, and there is no place for the fourth.
    assert [result.done_ns - START_NS for result in results] == [20 * MS, 40 * MS, 60 * MS, 0]
    assert [result.rejection for result in results] == [None, None, None, Rejection.UNVERIFIED]
    later_ns = START_NS + 100 * MS
    assert one.verify(signed(cars[0], later_ns, False), later_ns).done_ns - later_ns == 10 * MS
    assert one.verify(geonetworking_packet(b"x"), START_NS).done_ns == START_NS  # no signature, no time


def test_certificates_once_a_second(pki: Pki, builder: PacketBuilder, payload: bytes) -> None:
    one = verifier(pki)
    sizes = []
    for at_ms in range(0, 2100, 300):
        packet = builder.packet(7, START_NS + at_ms * MS, payload)
        assert one.verify(packet, START_NS + at_ms * MS).rejection is None
        sizes.append(len(packet))
    small = min(sizes)
    assert [size > small for size in sizes] == [True, False, False, False, True, False, False]
    assert max(sizes) - small == 132
    plain = PacketBuilder(V2x(geonetworking=True), 1, START_NS).packet(7, START_NS, payload)
    assert small - len(plain) == 93

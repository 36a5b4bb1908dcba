"""A receiver's checks of secured messages, and why one does not reach its facilities (1609.2, 5.2)."""

from __future__ import annotations

from collections import OrderedDict, deque
from enum import Enum
from typing import NamedTuple

from advpipe.pipeline.v2x.geonetworking.packet import PacketError, parse_packet
from advpipe.pipeline.v2x.message_type import MESSAGE_TYPES
from advpipe.pipeline.v2x.section import SecurityRules
from advpipe.pipeline.v2x.security.certificate import Certificate
from advpipe.pipeline.v2x.security.coer import EnvelopeError
from advpipe.pipeline.v2x.security.envelope import Envelope

REMEMBERED = 4096
"""Envelopes and certificates whose check is remembered, the same for all receivers."""


_PSIDS = frozenset(each.psid for each in MESSAGE_TYPES.values())


class Rejection(Enum):
    """Why a receiver's security entity rejects a message."""

    MALFORMED = "malformed"
    """No packet, or an envelope that is truncated or of another profile."""
    UNSIGNED = "unsigned"
    NOT_PERMITTED = "not permitted"
    """The ticket does not permit such messages, or the envelope is for others."""
    STALE = "stale"
    """Signed longer ago than `max_age_s`."""
    FUTURE = "from the future"
    """Signed later than now by more than `clock_tolerance_s`."""
    UNKNOWN_SIGNER = "unknown signer"
    """Signed with a digest, and the receiver has not seen the certificate."""
    EXPIRED_TICKET = "ticket not valid then"
    EXPIRED_AUTHORITY = "authority not valid then"
    UNTRUSTED = "untrusted ticket"
    """The authority has not issued it."""
    REPLAYED = "replayed"
    WRONG_SIGNATURE = "wrong signature"
    UNVERIFIED = "not verified"
    """The verification queue was full."""


class Verification(NamedTuple):
    """content: what was signed, None where it is rejected. done_ns: when the result is known."""

    content: bytes | None
    rejection: Rejection | None
    done_ns: int


class SignatureChecks:
    """What does not depend on the receiver: parsing, and the signatures of envelopes and tickets.

    Each is computed once, however many stations receive a message.
    """

    def __init__(self, authority: Certificate) -> None:
        self.authority = authority
        self._envelopes: OrderedDict[bytes, Envelope | Rejection] = OrderedDict()
        self._is_signed: OrderedDict[tuple[bytes, bytes], bool] = OrderedDict()
        self._is_issued: OrderedDict[bytes, bool] = OrderedDict()

    def open(self, packet: bytes) -> Envelope | Rejection:
        """The envelope in a packet, or why there is none."""
        if packet not in self._envelopes:
            _remember(self._envelopes, packet, _open(packet))
        return self._envelopes[packet]

    def is_issued(self, ticket: Certificate) -> bool:
        """Whether the authority has issued a ticket."""
        if ticket.encoded not in self._is_issued:
            _remember(self._is_issued, ticket.encoded, ticket.is_issued_by(self.authority))
        return self._is_issued[ticket.encoded]

    def is_signed(self, packet: bytes, envelope: Envelope, ticket: Certificate) -> bool:
        """Whether the holder of a ticket signed the envelope in a packet."""
        key = packet, ticket.encoded
        if key not in self._is_signed:
            _remember(self._is_signed, key, envelope.is_signed_by(ticket))
        return self._is_signed[key]


class MessageVerifier:
    """The security entity of one receiver: the tickets that it has seen, and its verification queue."""

    def __init__(self, rules: SecurityRules, checks: SignatureChecks) -> None:
        self._rules, self._checks = rules, checks
        self._max_age_ns = round(rules.max_age_s * 1e9)
        self._tolerance_ns = round(rules.clock_tolerance_s * 1e9)
        self._time_ns = round(rules.verification_time_s * 1e9)
        self._tickets: dict[bytes, Certificate] = {}
        self._accepted: OrderedDict[bytes, int] = OrderedDict()
        self._busy_until_ns: deque[int] = deque()

    def verify(self, packet: bytes, now_ns: int) -> Verification:
        """Check a packet that arrives now; call it in the order of arrivals.

        A signature takes `verification_time_s`, and a ticket that is new to this receiver has one of its own.
        What can be told without a signature is told at once, and does not wait in the queue.
        """
        envelope = self._checks.open(packet)
        if isinstance(envelope, Rejection):
            return Verification(None, envelope, now_ns)
        ticket = self._ticket(envelope)
        rejection = self._before_signatures(envelope, ticket, now_ns)
        if rejection is not None or ticket is None:
            return Verification(None, rejection, now_ns)
        is_new = ticket.digest not in self._tickets
        done_ns = self._queued(now_ns, 2 if is_new else 1)
        if done_ns is None:
            return Verification(None, Rejection.UNVERIFIED, now_ns)
        if is_new and not self._checks.is_issued(ticket):
            return Verification(None, Rejection.UNTRUSTED, done_ns)
        if not self._checks.is_signed(packet, envelope, ticket):
            return Verification(None, Rejection.WRONG_SIGNATURE, done_ns)
        self._tickets[ticket.digest] = ticket
        self._accepted[envelope.signature] = envelope.generation_ns
        return Verification(envelope.content, None, done_ns)

    def _ticket(self, envelope: Envelope) -> Certificate | None:
        if isinstance(envelope.signer, Certificate):
            return envelope.signer
        return self._tickets.get(envelope.signer)

    def _before_signatures(
        self, envelope: Envelope, ticket: Certificate | None, now_ns: int
    ) -> Rejection | None:
        if envelope.generation_ns < now_ns - self._max_age_ns:
            return Rejection.STALE
        if envelope.generation_ns > now_ns + self._tolerance_ns:
            return Rejection.FUTURE
        if ticket is None:
            return Rejection.UNKNOWN_SIGNER
        if envelope.psid not in _PSIDS or envelope.psid not in ticket.permissions:
            return Rejection.NOT_PERMITTED
        if not ticket.is_valid_at(envelope.generation_ns):
            return Rejection.EXPIRED_TICKET
        if not self._checks.authority.is_valid_at(envelope.generation_ns):
            return Rejection.EXPIRED_AUTHORITY
        self._forget(now_ns)
        return Rejection.REPLAYED if envelope.signature in self._accepted else None

    def _forget(self, now_ns: int) -> None:
        """Forget signatures so old that their age alone rejects them."""
        horizon_ns = now_ns - self._max_age_ns - self._tolerance_ns
        while self._accepted and next(iter(self._accepted.values())) < horizon_ns:
            self._accepted.popitem(last=False)

    def _queued(self, now_ns: int, signatures: int) -> int | None:
        """When the signatures of a message that arrives now are verified; None if the queue is full."""
        queue = self._busy_until_ns
        while queue and queue[0] <= now_ns:
            queue.popleft()
        if not self._time_ns:
            return now_ns
        if len(queue) > self._rules.verification_queue:
            return None
        queue.append(max(now_ns, queue[-1] if queue else now_ns) + signatures * self._time_ns)
        return queue[-1]


def _open(packet: bytes) -> Envelope | Rejection:
    try:
        basic = parse_packet(packet)
        return Envelope.decode(basic.content) if basic.is_secured else Rejection.UNSIGNED
    except (PacketError, EnvelopeError):
        return Rejection.MALFORMED


def _remember(store: OrderedDict, key: object, value: object) -> None:  # type: ignore[type-arg]
    store[key] = value
    if len(store) > REMEMBERED:
        store.popitem(last=False)

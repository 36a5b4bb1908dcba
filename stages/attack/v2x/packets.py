"""The packets of attacked messages: what an attacker's radio signs, and with which credentials."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import replace

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import Credentials
from advpipe.pipeline.v2x.channel import ChannelResult, Sent
from advpipe.pipeline.v2x.message_type import message_type_of
from advpipe.pipeline.v2x.security.keys import SigningKey
from advpipe.pipeline.v2x.security.pki import TICKET_HOURS, Holder, Pki
from advpipe.pipeline.v2x.stack import PacketBuilder

REMEMBERED = 100_000
"""Packets that an outsider can send again."""


class AttackedPackets:
    """Gives every message that editors changed, moved or added a packet of its radio.

    credentials: of the attackers, by station id. A station that is not an attacker signs with its own ticket,
    also what it sends in error. An outsider cannot sign: what it sends of another station, word for word, is
    in that station's packet.

    counts: receptions of attacked messages by verdict, where the drive is signed.
    """

    def __init__(self, drive: V2xDrive, credentials: Mapping[int, Credentials]) -> None:
        self._drive, self._credentials = drive, credentials
        self._overheard: OrderedDict[bytes, bytes] = OrderedDict()
        self._attacked: set[int] = set()
        self.counts: Counter[str] = Counter()
        self._builder: PacketBuilder | None = None
        is_signed = drive.v2x.security != "none"
        if not is_signed and (
            outsiders := sorted({each for each in credentials.values() if each != "ticket"})
        ):
            raise UsageError(
                f"credentials are {outsiders[0]!r}, but the drive was recorded without security "
                "(v2x.security is none); leave them out, or record it with v2x.security: etsi"
            )
        if drive.v2x.has_packets:
            holders = _holders(drive, credentials) if is_signed else {}
            self._builder = PacketBuilder(drive.v2x, drive.seed, drive.start_ns, holders)

    def packed(self, recorded: Sequence[Sent], sent: Sequence[Sent]) -> list[Sent]:
        """The messages of a step with their packets; those as recorded keep theirs."""
        if self._builder is None:
            return list(sent)
        unchanged = {one.number: _content(one) for one in recorded}
        for one in recorded:
            self._builder.note(one.station_id, one.payload)
        packed = list(sent)
        for index, one in enumerate(sent):
            if unchanged.get(one.number) != _content(one):
                packed[index] = self._pack(self._builder, one)
                self._attacked.add(one.number)
        for one in recorded:
            self._overheard[one.payload] = one.packet
            if len(self._overheard) > REMEMBERED:
                self._overheard.popitem(last=False)
        return packed

    def observe(self, result: ChannelResult) -> None:
        """Count what became of attacked messages at receivers that verify signatures."""
        if self._drive.v2x.security == "none":
            return
        for received in result.received:
            if received.sent.number in self._attacked:
                self.counts[f"attacked {_kind(received.sent)} that receivers verified"] += 1
        for one in result.rejected:
            if one.sent.number in self._attacked:
                self.counts[f"attacked {_kind(one.sent)} that receivers rejected: {one.rejection.value}"] += 1

    def _pack(self, builder: PacketBuilder, sent: Sent) -> Sent:
        credentials = self._credentials.get(sent.station_id, "ticket")
        if credentials != "ticket" and sent.payload in self._overheard:
            return replace(sent, packet=self._overheard[sent.payload])
        is_signed = credentials != "none"
        packet = builder.packet(sent.station_id, sent.request_ns, sent.payload, is_signed=is_signed)
        return replace(sent, packet=packet)


def _kind(sent: Sent) -> str:
    return f"{message_type_of(sent.payload).codec.name}s"


def _content(sent: Sent) -> tuple[int, int, bytes]:
    return sent.station_id, sent.request_ns, sent.payload


def _holders(drive: V2xDrive, credentials: Mapping[int, Credentials]) -> dict[int, Holder]:
    """What attackers without a valid ticket sign with."""
    pki, own = (Pki.of(drive.v2x, drive.seed, drive.start_ns, name) for name in ("drive", "outsider"))
    honest = sorted(set(drive.stations) - set(credentials))
    holders: dict[int, Holder] = {}
    for attacker, kind in credentials.items():
        if kind == "untrusted":
            holders[attacker] = own.ticket(attacker)
        elif kind == "expired":
            start_s = pki.start_s - TICKET_HOURS * 3600
            holders[attacker] = pki.ticket(attacker, "expired", start_s=start_s, hours=TICKET_HOURS - 1)
        elif kind == "stolen" and honest:
            rng = named_generator(drive.seed, "attack", "stolen certificate", attacker)
            ticket, _ = pki.ticket(honest[int(rng.integers(len(honest)))])
            holders[attacker] = ticket, SigningKey(drive.seed, "outsider", attacker)
    return holders

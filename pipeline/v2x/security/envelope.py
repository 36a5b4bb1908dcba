"""Signed envelopes of ETSI TS 103 097 v1.3.1, clause 5.2, a profile of IEEE 1609.2, in COER."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.v2x.codec.timestamps import NS_PER_MS, timestamp_its_ms, unix_ns
from advpipe.pipeline.v2x.message_type import CAM
from advpipe.pipeline.v2x.security.certificate import (
    DIGEST_BYTES,
    Certificate,
    read_ticket,
    signed_data,
)
from advpipe.pipeline.v2x.security.coer import CoerReader, EnvelopeError, length_prefixed
from advpipe.pipeline.v2x.security.keys import SigningKey, encode_signature, read_signature

_SIGNED_SHA256 = bytes.fromhex("03 81 00")
"""Version 3, signed, SHA-256."""
_UNSECURED = bytes.fromhex("40 03 80")
"""The payload is data, not a hash: version 3, unsecured."""
_WITH_TIME, _WITH_PLACE = b"\x40", b"\x50"
"""Which header fields follow: the generation time, and the generation location as well."""
LOCATION_BYTES = 10
_BY_DIGEST, _BY_CERTIFICATE = b"\x80", bytes.fromhex("81 01 01")


@dataclass(frozen=True)
class Envelope:
    """content: what is signed, from GeoNetworking's common header on. psid: what kind of message it is.

    time_us: generation, TAI since 2004. location: where it was signed, as DENMs state it: latitude, longitude
    and elevation in ten bytes; empty for other messages. signer: the ticket, or its digest of eight bytes.
    signature: 64 bytes.
    """

    content: bytes
    psid: int
    time_us: int
    signer: Certificate | bytes
    signature: bytes
    location: bytes = b""

    @property
    def digest(self) -> bytes:
        """The digest of the signer's ticket."""
        return self.signer.digest if isinstance(self.signer, Certificate) else self.signer

    @property
    def generation_ns(self) -> int:
        """When it was signed, UTC since 1970."""
        ms, us = divmod(self.time_us, 1000)
        return unix_ns(ms) + us * 1000

    def encode(self) -> bytes:
        """EtsiTs103097Data-Signed in COER."""
        if isinstance(self.signer, Certificate):
            signer = _BY_CERTIFICATE + self.signer.encoded
        else:
            signer = _BY_DIGEST + self.signer
        signed = to_be_signed(self.content, self.psid, self.time_us, self.location)
        return _SIGNED_SHA256 + signed + signer + encode_signature(self.signature)

    @classmethod
    def decode(cls, data: bytes) -> Envelope:
        """The envelope in these bytes. Raises EnvelopeError for anything but a whole one."""
        reader = CoerReader(data)
        reader.expect(_SIGNED_SHA256 + _UNSECURED, "the start of an envelope")
        content = reader.octets()
        fields = reader.take(1)
        if fields not in (_WITH_TIME, _WITH_PLACE):
            raise EnvelopeError(f"the choice of header fields is {fields.hex()}, which advpipe does not read")
        psid = int.from_bytes(reader.octets(), "big")
        time_us = reader.unsigned(8)
        location = reader.take(LOCATION_BYTES) if fields == _WITH_PLACE else b""
        signer: Certificate | bytes
        if (kind := reader.take(1)) == _BY_DIGEST:
            signer = reader.take(DIGEST_BYTES)
        elif kind == _BY_CERTIFICATE[:1]:
            reader.expect(_BY_CERTIFICATE[1:], "the number of certificates")
            signer = read_ticket(reader)
        else:
            raise EnvelopeError(f"the signer's choice {kind.hex()} is neither a digest nor a certificate")
        signature = read_signature(reader)
        reader.end()
        return cls(content, psid, time_us, signer, signature, location)

    def is_signed_by(self, ticket: Certificate) -> bool:
        """Whether the holder of a ticket signed it."""
        signed = to_be_signed(self.content, self.psid, self.time_us, self.location)
        data = signed_data(signed, ticket.encoded)
        return ticket.key.is_signed(data, self.signature)


def sign_envelope(
    content: bytes,
    now_ns: int,
    ticket: Certificate,
    key: SigningKey,
    with_certificate: bool,
    psid: int = CAM.psid,
    location: bytes = b"",
) -> Envelope:
    """The envelope of a message in a packet, signed with a ticket's key. psid: the kind of message.

    location: see `Envelope`.
    """
    time_us = timestamp_its_ms(now_ns) * 1000 + now_ns % NS_PER_MS // 1000
    signature = key.sign(signed_data(to_be_signed(content, psid, time_us, location), ticket.encoded))
    signer = ticket if with_certificate else ticket.digest
    return Envelope(content, psid, time_us, signer, signature, location)


def to_be_signed(content: bytes, psid: int, time_us: int, location: bytes = b"") -> bytes:
    """ToBeSignedData in COER."""
    octets = psid.to_bytes((psid.bit_length() + 7) // 8 or 1, "big")
    fields = _WITH_PLACE if location else _WITH_TIME
    header = fields + length_prefixed(octets) + time_us.to_bytes(8, "big") + location
    return _UNSECURED + length_prefixed(content) + header

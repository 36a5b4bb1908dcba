"""Certificates of ETSI TS 103 097 v1.3.1, clause 7.2, a profile of IEEE 1609.2: explicit, on P-256, in COER.

An authorisation ticket is what a station signs its messages with: it has no name, and a bit map of what its
holder may send. Names, permissions to issue and an encryption key are for authorities alone.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.security.coer import CoerReader, EnvelopeError, length_prefixed
from advpipe.pipeline.v2x.security.keys import (
    SigningKey,
    VerificationKey,
    encode_signature,
    read_signature,
)

DIGEST_BYTES = 8
MOST_PERMISSIONS = 8

_START = bytes.fromhex("80 03 00")
"""A signature follows; version 3; explicit."""
_SELF_ISSUED = bytes.fromhex("81 00")
_ISSUER_DIGEST = b"\x80"
_TICKET, _ROOT, _AUTHORITY = 0x10, 0x18, 0x19
"""Which optional parts follow: permissions; and to issue; and an encryption key."""
_NAME, _NO_NAME = b"\x81", b"\x83"
_NO_REVOCATION = bytes(5)
"""cracaId and crlSeries, both 0 in TS 103 097."""
_HOURS = b"\x84"
_WITH_SSP, _BITMAP_SSP = b"\x80", b"\x81"
_ENCRYPTION_AES_P256 = bytes.fromhex("00 80")
_VERIFICATION_P256 = bytes.fromhex("80 80")

Permissions = Mapping[int, bytes]
"""Service-specific permissions, a bit map, by PSID (ITS-AID)."""


@dataclass(frozen=True)
class Certificate:
    """issuer: the HashedId8 of its issuer's certificate; None for a root. name: "" for a ticket.

    start_s: TAI since 2004. hours: for how long it is valid. key: verifies its holder's signatures.
    encryption: a compressed point, of an authority. signature: by its issuer, 64 bytes.
    """

    issuer: bytes | None
    start_s: int
    hours: int
    permissions: Permissions
    key: VerificationKey
    name: str = ""
    encryption: bytes = b""
    signature: bytes = bytes(64)
    encoded: bytes = field(init=False)
    digest: bytes = field(init=False)

    def __post_init__(self) -> None:
        issuer = _SELF_ISSUED if self.issuer is None else _ISSUER_DIGEST + self.issuer
        head = _START + issuer + self.to_be_signed
        object.__setattr__(self, "encoded", head + encode_signature(self.signature))
        object.__setattr__(self, "digest", hashlib.sha256(self.encoded).digest()[-DIGEST_BYTES:])

    @property
    def to_be_signed(self) -> bytes:
        """ToBeSignedCertificate in COER."""
        is_authority, name = bool(self.name), self.name.encode()
        kind = (_AUTHORITY if self.encryption else _ROOT) if is_authority else _TICKET
        parts = [
            bytes([kind]),
            _NAME + length_prefixed(name) if is_authority else _NO_NAME,
            _NO_REVOCATION,
            self.start_s.to_bytes(4, "big"),
            _HOURS + self.hours.to_bytes(2, "big"),
            bytes([1, len(self.permissions)]),
            *(_psid_ssp(psid, ssp) for psid, ssp in sorted(self.permissions.items())),
        ]
        if is_authority:
            levels = 1 if self.encryption else 2
            parts.append(_issue_permissions(levels))
        if self.encryption:
            parts.append(_ENCRYPTION_AES_P256 + self.encryption)
        return b"".join((*parts, _VERIFICATION_P256, self.key.encoded))

    def is_valid_at(self, unix_ns: int) -> bool:
        """Whether a time lies in its validity period."""
        return 0 <= timestamp_its_ms(unix_ns) - self.start_s * 1000 < self.hours * 3_600_000

    def is_issued_by(self, issuer: Certificate) -> bool:
        """Whether that certificate's holder signed it."""
        data = signed_data(self.to_be_signed, b"" if self.issuer is None else issuer.encoded)
        expected = None if issuer is self else issuer.digest
        return self.issuer == expected and issuer.key.is_signed(data, self.signature)

    def signed_by(self, key: SigningKey, issuer: Certificate | None) -> Certificate:
        """The same certificate with its issuer's signature; None: its own."""
        signature = key.sign(signed_data(self.to_be_signed, b"" if issuer is None else issuer.encoded))
        return Certificate(
            self.issuer,
            self.start_s,
            self.hours,
            self.permissions,
            self.key,
            self.name,
            self.encryption,
            signature,
        )


def signed_data(to_be_signed: bytes, signer: bytes) -> bytes:
    """What a signature covers: the hashes of the data and of the signer's certificate (1609.2, 5.3.1)."""
    return hashlib.sha256(to_be_signed).digest() + hashlib.sha256(signer).digest()


def read_ticket(reader: CoerReader) -> Certificate:
    """An authorisation ticket. Raises EnvelopeError for any other certificate."""
    reader.expect(_START, "the start of a certificate")
    reader.expect(_ISSUER_DIGEST, "the kind of issuer")
    issuer = reader.take(DIGEST_BYTES)
    reader.expect(bytes([_TICKET]) + _NO_NAME + _NO_REVOCATION, "the start of a ticket")
    start_s = reader.unsigned(4)
    reader.expect(_HOURS, "the unit of the validity")
    hours = reader.unsigned(2)
    reader.expect(b"\x01", "the size of the number of permissions")
    count = reader.unsigned(1)
    if not 1 <= count <= MOST_PERMISSIONS:
        raise EnvelopeError(f"a ticket has {count} permissions, not 1 to {MOST_PERMISSIONS}")
    permissions = dict(_read_psid_ssp(reader) for _ in range(count))
    if list(permissions) != sorted(permissions) or len(permissions) != count:
        raise EnvelopeError("the permissions of a ticket are not in order")
    reader.expect(_VERIFICATION_P256, "the kind of key")
    key = VerificationKey(reader.take(33))
    return Certificate(issuer, start_s, hours, permissions, key, signature=read_signature(reader))


def _psid_ssp(psid: int, ssp: bytes) -> bytes:
    octets = psid.to_bytes((psid.bit_length() + 7) // 8 or 1, "big")
    return _WITH_SSP + length_prefixed(octets) + _BITMAP_SSP + length_prefixed(length_prefixed(ssp))


def _read_psid_ssp(reader: CoerReader) -> tuple[int, bytes]:
    reader.expect(_WITH_SSP, "the presence of specific permissions")
    size = reader.length()
    octets = reader.take(size)
    if not 1 <= size <= 4 or (size > 1 and not octets[0]):
        raise EnvelopeError(f"{octets.hex()} is no PSID")
    reader.expect(_BITMAP_SSP, "the kind of specific permissions")
    inner = CoerReader(reader.octets())
    ssp = inner.octets()
    inner.end()
    return int.from_bytes(octets, "big"), ssp


def _issue_permissions(levels: int) -> bytes:
    """One group: all permissions, down to `levels` below, for applications."""
    if levels == 1:  # the default
        return bytes.fromhex("01 01 00 81")
    return bytes.fromhex("01 01 80 81 01 02")

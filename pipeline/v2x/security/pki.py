"""The public key infrastructure of a drive: a root, an authorisation authority, and stations' tickets."""

from __future__ import annotations

from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms
from advpipe.pipeline.v2x.message_type import CAM
from advpipe.pipeline.v2x.section import V2x
from advpipe.pipeline.v2x.security.certificate import Certificate, Permissions
from advpipe.pipeline.v2x.security.keys import SigningKey

CAM_PERMISSIONS: Permissions = {CAM.psid: CAM.permissions}
REVOCATION_PSID, TRUST_LIST_PSID, REQUEST_PSID = 622, 624, 623
"""What a root signs, and what an authority answers requests with (TS 102 965)."""

ROOT_HOURS, AUTHORITY_HOURS, TICKET_HOURS = 5 * 365 * 24, 3 * 365 * 24, 7 * 24
LEAD_S = 3600
"""Certificates are valid from an hour before the drive."""

Holder = tuple[Certificate, SigningKey]


class Pki:
    """Keys and certificates that a drive's seed determines.

    start_ns: the begin of the drive, UTC since 1970. name: another one gives other keys, such as an
    outsider's, whose root nobody trusts. permissions: of its tickets.
    """

    def __init__(
        self, seed: int, start_ns: int, name: str = "drive", permissions: Permissions = CAM_PERMISSIONS
    ) -> None:
        self._seed, self._name, self._permissions = seed, name, permissions
        self.start_s = timestamp_its_ms(start_ns) // 1000 - LEAD_S
        root_key, self._authority_key = self._key("root"), self._key("authority")
        lists = {REVOCATION_PSID: b"\x01", TRUST_LIST_PSID: b"\x01"}
        unsigned = Certificate(None, self.start_s, ROOT_HOURS, lists, root_key.public, f"{name} root")
        self.root = unsigned.signed_by(root_key, None)
        authority = Certificate(
            self.root.digest,
            self.start_s,
            AUTHORITY_HOURS,
            {REQUEST_PSID: bytes.fromhex("01 01")},
            self._authority_key.public,
            f"{name} authority",
            self._key("authority encryption").public.encoded,
        )
        self.authority = authority.signed_by(root_key, self.root)

    def ticket(
        self,
        *names: str | int,
        start_s: int | None = None,
        hours: int = TICKET_HOURS,
        permissions: Permissions | None = None,
    ) -> Holder:
        """A ticket and its key, for a station of these names.

        start_s: TAI since 2004, by default `self.start_s`. permissions: by PSID; None: those of the drive.
        """
        key = self._key("ticket", *names)
        begin_s = self.start_s if start_s is None else start_s
        allowed = self._permissions if permissions is None else permissions
        ticket = Certificate(self.authority.digest, begin_s, hours, allowed, key.public)
        return ticket.signed_by(self._authority_key, self.authority), key

    @classmethod
    def of(cls, v2x: V2x, seed: int, start_ns: int, name: str = "drive") -> Pki:
        """That of a drive, with tickets for all that its stations send."""
        permissions = {each.psid: each.permissions for each in v2x.message_types}
        return cls(seed, start_ns, name, permissions)

    def _key(self, *names: str | int) -> SigningKey:
        return SigningKey(self._seed, self._name, *names)

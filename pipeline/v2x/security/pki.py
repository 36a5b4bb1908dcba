"""The public key infrastructure of a drive: a root, an authorisation authority, and stations' tickets."""

from __future__ import annotations

from advpipe.pipeline.core.seeding import named_generator
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

DRIVE = "drive"
"""The name of the infrastructure that receivers trust."""

Holder = tuple[Certificate, SigningKey]


class Pki:
    """Keys and certificates that a drive's seed determines.

    start_ns: the begin of the drive, UTC since 1970. name: another one gives other keys, such as an
    outsider's, whose root nobody trusts. permissions: of its tickets. is_expired: its root and its authority
    were valid until an hour before the drive.
    """

    def __init__(
        self,
        seed: int,
        start_ns: int,
        name: str = DRIVE,
        permissions: Permissions = CAM_PERMISSIONS,
        is_expired: bool = False,
    ) -> None:
        self._seed, self._name, self._permissions = seed, name, permissions
        self.start_s = timestamp_its_ms(start_ns) // 1000 - LEAD_S
        root_s, authority_s = (
            self.start_s - (hours * 3600 if is_expired else 0) for hours in (ROOT_HOURS, AUTHORITY_HOURS)
        )
        root_key, self._authority_key = self._key("root"), self._key("authority")
        lists = {REVOCATION_PSID: b"\x01", TRUST_LIST_PSID: b"\x01"}
        unsigned = Certificate(None, root_s, ROOT_HOURS, lists, root_key.public, f"{name} root")
        self.root = unsigned.signed_by(root_key, None)
        authority = Certificate(
            self.root.digest,
            authority_s,
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
    def of(cls, v2x: V2x, seed: int, start_ns: int, name: str = DRIVE) -> Pki:
        """That of a drive, with tickets for all that its stations send."""
        permissions = {each.psid: each.permissions for each in v2x.message_types}
        is_expired = v2x.security_rules.expired_authority and name == DRIVE
        return cls(seed, start_ns, name, permissions, is_expired)

    def _key(self, *names: str | int) -> SigningKey:
        return SigningKey(self._seed, self._name, *names)


def honest_ticket(pki: Pki, v2x: V2x, seed: int, names: tuple[int, ...]) -> Holder:
    """The ticket of a station that does not attack. names: of its radio, and of its pseudonym.

    It has expired, or does not permit CAMs, at the shares of stations that `v2x.security_rules` sets.
    """
    rules, radio = v2x.security_rules, names[0]
    if rules.expired_share or rules.unpermitted_share:
        rng = named_generator(seed, "v2x", "security", "faulty ticket", radio)
        if rng.random() < rules.expired_share:
            start_s = pki.start_s - TICKET_HOURS * 3600
            return pki.ticket(*names, start_s=start_s, hours=TICKET_HOURS)
        if rng.random() < rules.unpermitted_share:
            return pki.ticket(*names, permissions={REQUEST_PSID: b"\x01"})
    return pki.ticket(*names)

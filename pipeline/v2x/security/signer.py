"""What a station signs its messages with, and when it includes its certificate (TS 103 097, 7.1.1)."""

from __future__ import annotations

from advpipe.pipeline.v2x.security.envelope import sign_envelope
from advpipe.pipeline.v2x.security.pki import Holder


class EnvelopeSigner:
    """The security entity of one station. interval_ns: the shortest time between two certificates.

    In between, messages carry the certificate's digest. Certificates that others ask for are not sent out of
    turn.
    """

    def __init__(self, holder: Holder, interval_ns: int) -> None:
        self._ticket, self._key = holder
        self._interval_ns = interval_ns
        self._last_ns: int | None = None

    def sign(self, content: bytes, now_ns: int, psid: int, location: bytes = b"") -> bytes:
        """The envelope of a packet. psid: the kind of message in it. location: see `Envelope`.

        A message with a location, that is a DENM, always has the certificate (TS 103 097, 7.1.2).
        """
        if location:
            envelope = sign_envelope(content, now_ns, self._ticket, self._key, True, psid, location)
            return envelope.encode()
        is_due = self._last_ns is None or now_ns - self._last_ns >= self._interval_ns
        if is_due:
            self._last_ns = now_ns
        return sign_envelope(content, now_ns, self._ticket, self._key, is_due, psid).encode()

"""Encoding and decoding of one type of message in unaligned PER, by pycrate's compiled ASN.1.

`uper.py` handles the plain cases, nearly all, several times faster; pycrate handles the rest and reports what
is wrong with invalid ones. Where both apply, they agree bit for bit.

The values are pycrate's: a dict for a SEQUENCE, (name, value) for a CHOICE, a list for a SEQUENCE OF, a
name for an ENUMERATED, (bits, number of bits) for a BIT STRING.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from threading import Lock
from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.uper import Uper

MessageTree = dict[str, Any]

PYCRATE_LOCK = Lock()
"""pycrate's type object holds the value it processes, so only one call may run at a time."""


@dataclass(frozen=True)
class MessageCodec:
    """The codec of one type of message.

    name: as in "a CAM". load: imports and returns pycrate's object of the type. protocol_version, message_id:
    of its header, which every valid message has. error: what is raised for invalid ones. message_id_field:
    the name of the header's message id, which release 2 of the dictionary spells differently.
    """

    name: str
    load: Callable[[], Any]
    protocol_version: int
    message_id: int
    error: type[MessageError]
    message_id_field: str = "messageID"

    def encode(self, tree: MessageTree) -> bytes:
        """Encode a message. Raises `error` for values that the ASN.1 does not allow."""
        asn1 = self.asn1
        with suppress(Exception):  # pycrate raises it again, with the reason
            return self._uper.encode(tree)
        with PYCRATE_LOCK:
            try:
                return bytes(asn1.to_uper(deepcopy(tree)))  # which drops default values from it
            except Exception as error:  # pycrate's own errors, and others for values of a wrong type
                raise self.error(f"cannot encode these values as a {self.name}: {_reason(error)}") from None

    def decode(self, payload: bytes) -> MessageTree:
        """Decode a message to its ASN.1 values.

        Raises `error` for anything but one complete message of this type and protocol version: truncated or
        malformed bytes, another message, or bytes after the end. The padding bits of the last byte are
        ignored, and extensions of later releases in a SEQUENCE are skipped, as a receiver of this release
        does.
        """
        uper, tree = self._uper, None
        with suppress(Exception):
            tree = uper.decode(payload)
        if tree is None:
            tree = self._decode_slowly(payload)
        self._refuse_other_messages(tree["header"])
        return tree

    @cached_property
    def asn1(self) -> Any:
        """pycrate's object of the type."""
        return self.load()

    @property
    def open_types(self) -> Mapping[str, Mapping[int, tuple[str, Any]]]:
        """Of types that hold a number, and bytes of a type that depends on it: name and pycrate's object of
        each, by the number."""
        return {}

    @cached_property
    def _uper(self) -> Uper:
        return Uper(self.asn1)

    def _decode_slowly(self, payload: bytes) -> MessageTree:
        from pycrate_core.charpy import Charpy

        stream = Charpy(bytes(payload))
        with PYCRATE_LOCK:
            try:
                self.asn1.from_uper(stream)
                tree: MessageTree = self.asn1.get_val()
            except Exception as error:  # pycrate raises several classes, and some by accident
                reason = _reason(error)
                raise self.error(f"{len(payload)} bytes are not a {self.name}: {reason}") from None
        self._refuse_other_messages(tree["header"])
        if stream.len_bit():
            raise self.error(f"{stream.len_bit() // 8} bytes follow a {self.name} of {len(payload)} bytes")
        kept: MessageTree = without_additions(tree)
        return kept

    def _refuse_other_messages(self, header: MessageTree) -> None:
        found = header["protocolVersion"], header[self.message_id_field]
        if found != (self.protocol_version, self.message_id):
            raise self.error(
                f"message {found[1]} of protocol version {found[0]} is not a {self.name}, which is message "
                f"{self.message_id} of version {self.protocol_version}"
            )


def without_additions(value: Any) -> Any:
    """Drops unknown extensions: pycrate decodes them to `_ext_...`, but cannot encode them again."""
    if isinstance(value, dict):
        return {name: without_additions(part) for name, part in value.items() if not name.startswith("_ext_")}
    if isinstance(value, list):
        return [without_additions(part) for part in value]
    if isinstance(value, tuple) and isinstance(value[0], str):
        return value[0], without_additions(value[1])
    return value


def _reason(error: Exception) -> str:
    return f"{error or type(error).__name__}".splitlines()[0]

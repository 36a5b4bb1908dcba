"""Encoding and decoding of CAMs: unaligned PER from pycrate's compiled EN 302 637-2 v1.4.1.

`uper.py` handles the plain cases, nearly all, several times faster; pycrate handles the rest and reports what
is wrong with invalid ones. Where both apply, they agree bit for bit.

The values are pycrate's: a dict for a SEQUENCE, (name, value) for a CHOICE, a list for a SEQUENCE OF, a
name for an ENUMERATED, (bits, number of bits) for a BIT STRING.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from threading import Lock
from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.uper import Uper

PROTOCOL_VERSION = 2
MESSAGE_ID_CAM = 2

CamTree = dict[str, Any]

_LOCK = Lock()
"""pycrate's type object holds the value it processes, so only one call may run at a time."""


@cache
def asn1_cam() -> Any:
    """pycrate's object for the ASN.1 type CAM."""
    from pycrate_asn1dir import ITS_CAM_2  # 0.05 s

    return ITS_CAM_2.CAM_PDU_Descriptions.CAM


@cache
def _uper() -> Uper:
    return Uper(asn1_cam())


def encode_cam_tree(tree: CamTree) -> bytes:
    """Encode a CAM in UPER. Raises CamError for values that the ASN.1 does not allow."""
    with suppress(Exception):  # pycrate raises it again, with the reason
        return _uper().encode(tree)
    asn1 = asn1_cam()
    with _LOCK:
        try:
            return bytes(asn1.to_uper(tree))
        except Exception as error:  # pycrate's own errors, and others for values of a wrong type
            raise CamError(f"cannot encode these values as a CAM: {_reason(error)}") from None


def decode_cam_tree(payload: bytes) -> CamTree:
    """Decode a CAM in UPER to its ASN.1 values.

    Raises CamError for anything but one complete CAM of this protocol version: truncated or malformed
    bytes, another message, or bytes after the end. The padding bits of the last byte are ignored, and
    extensions of later releases in a SEQUENCE are skipped, as a receiver of this release does.
    """
    tree: CamTree | None = None
    with suppress(Exception):
        tree = _uper().decode(payload)
    if tree is None:
        tree = _decode_slowly(payload)
    _refuse_other_messages(tree["header"])
    return tree


def _decode_slowly(payload: bytes) -> CamTree:
    from pycrate_core.charpy import Charpy

    asn1, stream = asn1_cam(), Charpy(bytes(payload))
    with _LOCK:
        try:
            asn1.from_uper(stream)
            tree: CamTree = asn1.get_val()
        except Exception as error:  # pycrate raises several classes, and some by accident
            raise CamError(f"{len(payload)} bytes are not a CAM: {_reason(error)}") from None
    _refuse_other_messages(tree["header"])
    if stream.len_bit():
        raise CamError(f"{stream.len_bit() // 8} bytes follow a CAM of {len(payload)} bytes")
    kept: CamTree = _without_additions(tree)
    return kept


def _without_additions(value: Any) -> Any:
    """Drops unknown extensions: pycrate decodes them to `_ext_...`, but cannot encode them again."""
    if isinstance(value, dict):
        return {
            name: _without_additions(part) for name, part in value.items() if not name.startswith("_ext_")
        }
    if isinstance(value, list):
        return [_without_additions(part) for part in value]
    if isinstance(value, tuple) and isinstance(value[0], str):
        return value[0], _without_additions(value[1])
    return value


def _refuse_other_messages(header: CamTree) -> None:
    version, message = header["protocolVersion"], header["messageID"]
    if (version, message) != (PROTOCOL_VERSION, MESSAGE_ID_CAM):
        raise CamError(
            f"message {message} of protocol version {version} is not a CAM, which is message "
            f"{MESSAGE_ID_CAM} of version {PROTOCOL_VERSION}"
        )


def _reason(error: Exception) -> str:
    return f"{error or type(error).__name__}".splitlines()[0]

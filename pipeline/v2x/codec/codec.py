"""CAMs between bytes and values: unaligned PER after pycrate's compiled EN 302 637-2 v1.4.1.

`uper.py` takes the plain cases, nearly all, several times as fast; pycrate takes the rest and says what is
wrong with bad ones. Where both can, they agree to the bit.

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
"""pycrate's type object holds the value it works on: one call at a time."""


@cache
def asn1_cam() -> Any:
    """pycrate's object of the ASN.1 type CAM."""
    from pycrate_asn1dir import ITS_CAM_2  # 0.05 s

    return ITS_CAM_2.CAM_PDU_Descriptions.CAM


@cache
def _uper() -> Uper:
    return Uper(asn1_cam())


def encode_cam_tree(tree: CamTree) -> bytes:
    """The CAM in UPER. Raises CamError for values that the ASN.1 does not allow."""
    with suppress(Exception):  # whatever it is, pycrate finds it again
        return _uper().encode(tree)
    asn1 = asn1_cam()
    with _LOCK:
        try:
            return bytes(asn1.to_uper(tree))
        except Exception as error:  # pycrate's own, and any other for values of another type
            raise CamError(f"these values make no CAM: {_reason(error)}") from None


def decode_cam_tree(payload: bytes) -> CamTree:
    """The values of a CAM in UPER.

    Raises CamError for anything but one whole CAM of this protocol version: truncated or malformed
    bytes, another message, or bytes after the end. The bits that pad the last byte are not looked at, and
    what later releases added to a SEQUENCE is passed over, as a receiver of this release does.
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
        except Exception as error:  # pycrate raises several kinds, and some by accident
            raise CamError(f"{len(payload)} bytes are no CAM: {_reason(error)}") from None
    _refuse_other_messages(tree["header"])
    if stream.len_bit():
        raise CamError(f"{stream.len_bit() // 8} bytes follow a CAM of {len(payload)} bytes")
    kept: CamTree = _without_additions(tree)
    return kept


def _without_additions(value: Any) -> Any:
    """pycrate decodes unknown additions to `_ext_...`, but encodes those without their bytes."""
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
            f"message {message} of protocol version {version} is no CAM, which is message "
            f"{MESSAGE_ID_CAM} of version {PROTOCOL_VERSION}"
        )


def _reason(error: Exception) -> str:
    return f"{error or type(error).__name__}".splitlines()[0]

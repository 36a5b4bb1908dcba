"""Encoding and decoding of CAMs: unaligned PER from pycrate's compiled EN 302 637-2 v1.4.1."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.message_codec import MessageCodec, MessageTree

PROTOCOL_VERSION = 2
MESSAGE_ID_CAM = 2

CamTree = MessageTree


def _asn1() -> Any:
    from pycrate_asn1dir import ITS_CAM_2  # 0.05 s

    return ITS_CAM_2.CAM_PDU_Descriptions.CAM


CAM_CODEC = MessageCodec("CAM", _asn1, PROTOCOL_VERSION, MESSAGE_ID_CAM, CamError)


def asn1_cam() -> Any:
    """pycrate's object for the ASN.1 type CAM."""
    return CAM_CODEC.asn1


def encode_cam_tree(tree: CamTree) -> bytes:
    """Encode a CAM in UPER. Raises CamError for values that the ASN.1 does not allow."""
    return CAM_CODEC.encode(tree)


def decode_cam_tree(payload: bytes) -> CamTree:
    """Decode a CAM in UPER to its ASN.1 values; see `MessageCodec.decode`. Raises CamError."""
    return CAM_CODEC.decode(payload)

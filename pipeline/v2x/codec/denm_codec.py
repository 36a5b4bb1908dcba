"""Encoding and decoding of DENMs: unaligned PER from pycrate's compiled EN 302 637-3 v1.3.1."""

from __future__ import annotations

from typing import Any

from advpipe.pipeline.v2x.codec.cam_error import MessageError
from advpipe.pipeline.v2x.codec.message_codec import MessageCodec

DENM_PORT = 2002
"""Well-known destination port of DENMs (ETSI TS 103 248)."""


class DenmError(MessageError):
    """The bytes are not a valid DENM, or the values cannot be encoded as one."""


def _asn1() -> Any:
    from pycrate_asn1dir import ITS_DENM_3

    return ITS_DENM_3.DENM_PDU_Descriptions.DENM


DENM_CODEC = MessageCodec("DENM", _asn1, 2, 1, DenmError)

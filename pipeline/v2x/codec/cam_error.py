"""The errors for invalid messages, on sending or on reception."""

from __future__ import annotations

from advpipe.pipeline.core.errors import AdvpipeError


class MessageError(AdvpipeError):
    """The bytes are not a valid message of its type, or the values cannot be encoded as one."""


class CamError(MessageError):
    """The bytes are not a valid CAM, or the values cannot be encoded as one."""

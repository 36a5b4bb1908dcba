"""The error for invalid CAMs, on sending or on reception."""

from __future__ import annotations

from advpipe.pipeline.core.errors import AdvpipeError


class CamError(AdvpipeError):
    """The bytes are not a valid CAM, or the values cannot be encoded as one."""

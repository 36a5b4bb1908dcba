"""What is wrong with a CAM, on sending or on reception."""

from __future__ import annotations

from advpipe.pipeline.core.errors import AdvpipeError


class CamError(AdvpipeError):
    """These bytes are no CAM, or these values make none."""

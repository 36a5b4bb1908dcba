"""The section `artery`: the program of `v2x.network: artery`."""

from __future__ import annotations

from pydantic import Field

from advpipe.pipeline.core.section import File, Positive, Section


class Artery(Section):
    """Artery with advpipe's module, which a script of the project builds; only with `v2x.network: artery`."""

    program: File | None = Field(
        None,
        description="path of advpipe-artery; by default the one that the environment variable "
        "ADVPIPE_ARTERY_BIN names, or else one on the PATH",
    )
    timeout_s: Positive = Field(
        120.0, ge=1, le=3600, description="longest time that Artery may take to start, or for one step"
    )

"""Whose radio medium sends the messages of a recorded drive again."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import RadioOf
from advpipe.pipeline.v2x.channel import RadioMedium

OpenRadio = Callable[[], AbstractContextManager[RadioMedium | None]]
"""Opens a medium, which ends with the context; None stands for ours (see `V2xDrive.channel`)."""


def radio_of(drive: V2xDrive, network: RadioOf) -> OpenRadio:
    """The medium of this name for a drive.

    Raises UsageError for a drive whose radio Artery cannot simulate, and without Artery.
    """
    if network == "embedded":
        return nullcontext
    from advpipe.pipeline.artery.given_drive import ArteryAgain

    return ArteryAgain(str(drive.path), drive.v2x.radio, drive.seed, drive.artery_timeout_s).open

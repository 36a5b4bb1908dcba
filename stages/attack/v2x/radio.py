"""Whose radio medium sends the messages of a recorded drive again."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

from pydantic import Field

from advpipe.pipeline.bag.latched import read_scenario_info
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import Document
from advpipe.pipeline.core.section import Positive
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.artery import Artery
from advpipe.pipeline.scenario.attacks import RadioOf
from advpipe.pipeline.v2x.channel import RadioMedium

OpenRadio = Callable[[], AbstractContextManager[RadioMedium | None]]
"""Opens a medium, which ends with the context; None stands for ours (see `V2xDrive.channel`)."""


class _Patience(Document):
    timeout_s: Positive = Field(Artery().timeout_s, le=3600)


class _ArteryInfo(Document):
    """How long Artery may take; which program it is, a bag cannot say."""

    artery: _Patience = Field(default_factory=_Patience)


def radio_of(reader: BagReader, drive: V2xDrive, network: RadioOf) -> OpenRadio:
    """The medium of this name for the drive of a bag.

    Raises UsageError for a drive whose radio Artery cannot simulate, and without Artery.
    """
    if network == "embedded":
        return nullcontext
    from advpipe.pipeline.artery.given_drive import ArteryAgain

    patience: _ArteryInfo = read_scenario_info(reader, _ArteryInfo)
    return ArteryAgain(str(reader.path), drive.v2x.radio, drive.seed, patience.artery.timeout_s).open

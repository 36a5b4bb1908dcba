"""What the frames of a bag are called: as in the drive's source, or by their place in the bag."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import SOURCE_FRAME

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
"""A name that is spelt in one way on every system."""

SIX_DIGITS = re.compile(r"\d{6}", re.ASCII)
"""How KITTI and OPV2V name frames."""


@dataclass(frozen=True)
class FrameNames:
    """names: the source's, by the time at which a frame was recorded; empty where its place names a frame."""

    names: Mapping[int, str] = field(default_factory=dict)

    def of(self, stamp_ns: int, index: int) -> str:
        """The name of a frame that can name files: the source's, else six digits, its place in the bag."""
        return self.names.get(stamp_ns, f"{index:06d}")


def read_frame_names(
    bag: Path, allowed: re.Pattern[str] = _FILE_NAME, *, is_ordered: bool = False
) -> FrameNames:
    """The source's names, if all of them are of the allowed form and no two are alike; else none.

    is_ordered: also only if their alphabetical order is that of time.
    """
    reader = BagReader(bag)
    found = reader.topics.get(SOURCE_FRAME.name)
    if found is None or found.type != SOURCE_FRAME.type:
        return FrameNames()
    messages = reader.raw_messages([SOURCE_FRAME.name])
    names = {raw.log_time_ns: str(reader.decode(raw).data) for raw in messages}
    in_time = [names[stamp_ns] for stamp_ns in sorted(names)]
    is_usable = all(_FILE_NAME.fullmatch(name) and allowed.fullmatch(name) for name in in_time)
    is_usable &= len({name.casefold() for name in in_time}) == len(in_time)
    if is_ordered:
        is_usable &= in_time == sorted(in_time)
    return FrameNames(names if is_usable else {})

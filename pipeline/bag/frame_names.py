"""What the frames of a bag are called: as in the drive's source, or by their place in the bag."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import CLOCK, SOURCE_FRAME

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")
"""A name that is spelt in one way on every system."""

_NUMBER = re.compile(r"0*(\d{1,6})", re.ASCII)
"""One that six digits can hold, which is how KITTI and OPV2V name frames."""


@dataclass(frozen=True)
class FrameNames:
    """names: the source's, by the time at which a frame was recorded; empty where its place names a frame."""

    names: Mapping[int, str] = field(default_factory=dict)

    def of(self, stamp_ns: int, index: int) -> str:
        """The name of a frame that can name files: the source's, else six digits, its place in the bag."""
        return self.names.get(stamp_ns, f"{index:06d}")


def read_frame_names(bag: Path, *, as_numbers: bool = False, is_ordered: bool = False) -> FrameNames:
    """The source's names, if every frame has one that can name a file and no two are alike; else none.

    as_numbers: only numbers, as six digits. is_ordered: only if their alphabetical order is that of time.
    """
    reader = BagReader(bag)
    found, clock = reader.topics.get(SOURCE_FRAME.name), reader.topics.get(CLOCK.name)
    # An import records the clock once a frame.
    if found is None or found.type != SOURCE_FRAME.type or clock is None or clock.count != found.count:
        return FrameNames()
    raws = reader.raw_messages([SOURCE_FRAME.name])
    names = {raw.log_time_ns: _usable(str(reader.decode(raw).data), as_numbers) for raw in raws}
    in_time = [names[stamp_ns] for stamp_ns in sorted(names)]
    is_usable = all(in_time) and len({name.casefold() for name in in_time}) == found.count
    if is_ordered:
        is_usable &= in_time == sorted(in_time)
    return FrameNames(names if is_usable else {})


def _usable(name: str, as_number: bool) -> str:
    """The name as it may stand in a file's; "" where it may not."""
    if as_number:
        match = _NUMBER.fullmatch(name)
        return match[1].zfill(6) if match else ""
    return name if _FILE_NAME.fullmatch(name) else ""

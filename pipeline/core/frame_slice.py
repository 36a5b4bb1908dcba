"""A selection of a bag's frames: `start:stop:step`, where each cloud is a frame."""

from __future__ import annotations

import re
from dataclasses import dataclass

from advpipe.pipeline.core.errors import UsageError

_PATTERN = re.compile(r"(\d*):(\d*)(?::(\d*))?")


@dataclass(frozen=True)
class FrameSlice:
    """Frames start, start + step, ... below stop; stop None means up to the end of the bag."""

    start: int = 0
    stop: int | None = None
    step: int = 1

    @staticmethod
    def parse(text: str) -> FrameSlice:
        """Parse `start:stop:step`, as in Python slices without negative numbers; `7` selects frame 7 only.

        Raises UsageError for another text.

        >>> FrameSlice.parse("::10").indices(25)
        range(0, 25, 10)
        """
        if text.isascii() and text.isdigit():
            return FrameSlice(int(text), int(text) + 1)
        match = _PATTERN.fullmatch(text)
        if match is None:
            raise UsageError(f"frames {text!r}: expected start:stop:step, such as 0:300:10 or 100:")
        start, stop, step = (int(part) if part else None for part in match.groups())
        if step == 0:
            raise UsageError(f"frames {text!r}: the step must be at least 1")
        return FrameSlice(start or 0, stop, step or 1)

    def indices(self, count: int) -> range:
        """The indices of the selected ones of `count` frames. Raises UsageError if none is selected."""
        chosen = range(*slice(self.start, self.stop, self.step).indices(count))
        if not chosen:
            known = f"; choose from 0 to {count - 1}" if count else ""
            raise UsageError(f"frames {self} select none of the bag's {count} frames{known}")
        return chosen

    def __str__(self) -> str:
        return f"{self.start}:{'' if self.stop is None else self.stop}:{self.step}"


ALL_FRAMES = FrameSlice()

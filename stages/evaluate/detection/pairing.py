"""The frames of a clean bag, each with those of adversarial bags that have the same stamp."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, Frame, FrameSlice, read_frames
from advpipe.pipeline.core.errors import AdvpipeError


def pair_frames(
    clean: Path,
    adversarial: Sequence[Path],
    chosen: FrameSlice = ALL_FRAMES,
    lidar_topic: str | None = None,
    *,
    is_part: bool = False,
) -> Iterator[tuple[Frame, list[Frame | None]]]:
    """The chosen frames of the clean bag in time order, each with its frame of every adversarial bag.

    An adversarial bag may lack frames. Raises AdvpipeError for an adversarial frame without a chosen clean
    one; with `is_part` such frames are skipped, as the adversarial bags may hold frames that were not chosen.
    """
    others = [read_frames(bag, lidar_topic=lidar_topic) for bag in adversarial]
    waiting = [next(frames, None) for frames in others]
    for before in read_frames(clean, chosen, lidar_topic=lidar_topic):
        pairs: list[Frame | None] = []
        for number, after in enumerate(waiting):
            while is_part and after is not None and after.stamp_ns < before.stamp_ns:
                after = waiting[number] = next(others[number], None)
            if after is not None and after.stamp_ns < before.stamp_ns:
                raise _foreign(adversarial[number], after.stamp_ns, clean)
            is_pair = after is not None and after.stamp_ns == before.stamp_ns
            pairs.append(after if is_pair else None)
            if is_pair:
                waiting[number] = next(others[number], None)
        yield before, pairs
    for number, after in enumerate(waiting):
        if after is not None and not is_part:
            raise _foreign(adversarial[number], after.stamp_ns, clean)


def _foreign(bag: Path, stamp_ns: int, clean: Path) -> AdvpipeError:
    return AdvpipeError(
        f"{bag} has a cloud of {stamp_ns} ns and {clean} has none: "
        "it was made from another bag; give the clean bag that was attacked"
    )

"""Which frame of an adversarial bag belongs to which of the clean bag: the one with the same stamp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.frame_reader import FrameReader
from advpipe.pipeline.bag.frames import Frame, find_lidar_topic, read_clouds
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError

Int64 = npt.NDArray[np.int64]

NO_FRAME = -1


def pair_frames(
    clean: Path,
    bag: Path,
    chosen: Sequence[int],
    lidar_topic: str | None = None,
    *,
    is_part: bool = False,
) -> Int64:
    """The frame (C,) of an adversarial bag for each chosen frame of the clean one; `NO_FRAME` where it has
    none.

    Clouds are known by their log times, which advpipe keeps, so only the indexes are read. Where other
    software logged the clouds at times of its own, their stamps count, and both bags are read once. Raises
    AdvpipeError for an adversarial frame without a chosen clean one; with `is_part` such frames are skipped,
    as the adversarial bag may hold frames that were not chosen.
    """
    times_ns = [_log_times_ns(each, lidar_topic) for each in (clean, bag)]
    if not all(_is_rising(each) for each in times_ns) or not np.isin(times_ns[1], times_ns[0]).all():
        times_ns = [_stamps_ns(each, lidar_topic) for each in (clean, bag)]
    before_ns, after_ns = times_ns[0][np.asarray(chosen)], times_ns[1]
    foreign = np.flatnonzero(~np.isin(after_ns, before_ns))
    if len(foreign) and not is_part:
        raise _foreign(bag, FrameReader(bag, lidar_topic).cloud(int(foreign[0])).stamp_ns, clean)
    place = np.minimum(np.searchsorted(after_ns, before_ns), len(after_ns) - 1)
    return np.where(after_ns[place] == before_ns, place, NO_FRAME)


@dataclass(frozen=True)
class FramePairs:
    """The frames of a clean bag that are scored, and those of its adversarial versions.

    chosen: (C,) rising numbers of frames of the clean bag. adversarial: by bag, (C,) as `pair_frames` gives
    them.
    """

    clean: Path
    chosen: tuple[int, ...]
    adversarial: Mapping[Path, Int64]
    lidar_topic: str | None = None

    @classmethod
    def of(
        cls,
        clean: Path,
        bags: Sequence[Path],
        chosen: Sequence[int],
        lidar_topic: str | None = None,
        *,
        is_part: bool = False,
    ) -> FramePairs:
        """The chosen frames that at least one of the bags holds; all of them, if there are no bags."""
        pairs = {bag: pair_frames(clean, bag, chosen, lidar_topic, is_part=is_part) for bag in bags}
        held = np.any([places != NO_FRAME for places in pairs.values()], axis=0)
        kept = np.flatnonzero(held) if bags else np.arange(len(chosen))
        frames = tuple(int(chosen[int(place)]) for place in kept)
        return cls(clean, frames, {bag: places[kept] for bag, places in pairs.items()}, lidar_topic)


class PairReader:
    """Reads single frames of the bags, as `FrameReader` does."""

    def __init__(self, pairs: FramePairs) -> None:
        self._pairs, topic = pairs, pairs.lidar_topic
        self._places = {index: place for place, index in enumerate(pairs.chosen)}
        self._clean = FrameReader(pairs.clean, topic)
        self._adversarial = {bag: FrameReader(bag, topic) for bag in pairs.adversarial}

    def frames(self, index: int) -> tuple[Frame, list[Frame | None]]:
        """A frame of the clean bag, and that of each adversarial bag. Raises AdvpipeError for bags that do
        not belong together."""
        before, place = self._clean.frame(index), self._places[index]
        versions: list[Frame | None] = []
        for bag, reader in self._adversarial.items():
            number = int(self._pairs.adversarial[bag][place])
            after = None if number == NO_FRAME else reader.frame(number)
            if after is not None and after.stamp_ns != before.stamp_ns:
                raise _foreign(bag, after.stamp_ns, self._pairs.clean)
            versions.append(after)
        return before, versions


def _foreign(bag: Path, stamp_ns: int, clean: Path) -> AdvpipeError:
    return AdvpipeError(
        f"{bag} has a cloud of {stamp_ns} ns and {clean} has none: "
        "it was made from another bag; give the clean bag that was attacked"
    )


def _log_times_ns(bag: Path, lidar_topic: str | None) -> Int64:
    reader = BagReader(bag)
    return reader.log_times_ns(find_lidar_topic(reader, lidar_topic))


def _is_rising(times_ns: Int64) -> bool:
    return bool((np.diff(times_ns) > 0).all())


def _stamps_ns(bag: Path, lidar_topic: str | None) -> Int64:
    """The stamp of each cloud (F,), ascending as their log times are."""
    stamps_ns = np.fromiter(
        (scan.stamp_ns for _, scan, _ in read_clouds(bag, lidar_topic=lidar_topic)), np.int64
    )
    if not _is_rising(stamps_ns):
        raise AdvpipeError(
            f"{bag}: clouds are logged in another order than their stamps, so they do not pair"
        )
    return stamps_ns

"""What is exported of bags: the chosen frames of the clean one, the same of the adversarial ones, splits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.frames import ALL_FRAMES, Frame, read_frames
from advpipe.pipeline.bag.locate import CLEAN_NAME
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.export.form import ExportOptions

VALIDATION_SHARE = 0.2
"""Of the frames, the last in time: neighbours in a drive look alike, and must not be in both splits."""


@dataclass(frozen=True)
class BagSelection:
    """clean: the one with the labels. attacked: those with other clouds, by name."""

    clean_name: str
    clean: Path
    attacked: Mapping[str, Path]
    left_out: tuple[str, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out, in a sentence."""
        if not self.left_out:
            return ()
        return (f"left out, since their clouds are the clean ones: {', '.join(self.left_out)}",)


def select_bags(bags: Mapping[str, Path]) -> BagSelection:
    """Take the clean bag, or the only one, and the adversarial bags whose clouds an attack changed."""
    name = CLEAN_NAME if CLEAN_NAME in bags else next(iter(bags))
    others = {other: bag for other, bag in bags.items() if other != name}
    attacked = {other: bag for other, bag in others.items() if _has_other_clouds(bag)}
    return BagSelection(name, bags[name], attacked, tuple(other for other in others if other not in attacked))


def clean_frames(bag: Path, options: ExportOptions) -> Iterator[Frame]:
    """The chosen frames, one in memory at a time."""
    frames = read_frames(bag, options.frames, lidar_topic=options.lidar_topic)
    yield from track(frames, "exporting the clean bag")


def attacked_clouds(
    bag: Path, names: Mapping[int, str], options: ExportOptions
) -> Iterator[tuple[str, Cloud]]:
    """The clouds of an adversarial bag by the names of the clean frames with their stamps.

    names: by stamp. Frames that were not chosen are skipped; an adversarial bag may lack some. Raises
    AdvpipeError for a cloud of no clean frame.
    """
    for frame in track(read_frames(bag, lidar_topic=options.lidar_topic), f"exporting {bag.name}"):
        if frame.stamp_ns in names:
            yield names[frame.stamp_ns], frame.cloud
        elif options.frames == ALL_FRAMES:
            raise AdvpipeError(
                f"{bag} has a cloud of {frame.stamp_ns} ns and the clean bag has none: it was made from "
                "another bag; attack the clean bag again, or export one bag alone"
            )


def write_splits(folder: Path, names: Sequence[str], validation: Sequence[str]) -> None:
    """Write ImageSets of the frames `names`: val.txt of those in `validation`, train.txt, trainval.txt."""
    sets = folder / "ImageSets"
    sets.mkdir(parents=True)
    chosen = {
        "train": [name for name in names if name not in set(validation)],
        "val": [name for name in names if name in set(validation)],
        "trainval": names,
        "test": [],
    }
    for split, members in chosen.items():
        (sets / f"{split}.txt").write_text("".join(f"{name}\n" for name in members), encoding="utf-8")


def validation_names(names: Sequence[str]) -> Sequence[str]:
    """The last `VALIDATION_SHARE` of the frames, at least one where there are two."""
    count = max(round(VALIDATION_SHARE * len(names)), min(1, len(names) - 1))
    return names[len(names) - count :]


def _has_other_clouds(bag: Path) -> bool:
    attacks = BagReader(bag).provenance.fields.attacks
    return not attacks or any(one.family == "lidar" for one in attacks)

"""The changes that an attack made to a bag, in numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted
from advpipe.stages.attack.lidar.base import LidarResult

MAX_NOTES = 8
"""The most notes that are printed: some contain numbers that differ in every frame."""


NOT_SCHEDULED = "not scheduled"
"""The note on a frame that the attack's schedule leaves out."""


@dataclass(repr=False)
class AttackSummary(Tabular):
    """Counts over all frames; `unchanged` ones stayed as they were.

    bag: the adversarial bag; as a path, the summary stands for it.
    losses: the detector's loss before and after, for each frame with an object.
    notes: what the user must know, with the number of frames concerned.
    replaced: topics with new messages. counts: of changes to messages, by name.
    """

    bag: Path
    frames: int = 0
    unchanged: int = 0
    points_clean: int = 0
    points_adversarial: int = 0
    losses: list[tuple[float, float]] = field(default_factory=list)
    notes: Counter[str] = field(default_factory=Counter)
    replaced: frozenset[str] = frozenset()
    counts: Counter[str] = field(default_factory=Counter)

    def add(self, points_clean: int, result: LidarResult) -> None:
        """Count one frame."""
        self.frames += 1
        self.unchanged += len(result.labels) == 0
        self.points_clean += points_clean
        self.points_adversarial += len(result.cloud)
        if not np.isnan(result.loss_before):
            self.losses.append((result.loss_before, result.loss_after))
        if result.note:
            self.notes[result.note] += 1

    @property
    def warnings(self) -> list[str]:
        """One line if clouds were to be changed and none was; empty otherwise."""
        if not self.frames or self.unchanged < self.frames:
            return []
        reasons = Counter({note: count for note, count in self.notes.items() if note != NOT_SCHEDULED})
        (reason, count), *_ = reasons.most_common(1) or [("the attack gave no reason", self.frames)]
        return [
            f"no cloud of {self.bag} was changed: {reason} ({count} of "
            f"{counted(self.frames, 'frame')}); choose other frames, or another attack"
        ]

    @property
    def mean_losses(self) -> tuple[float | None, float | None]:
        """The mean of the losses before and after; None without any."""
        if not self.losses:
            return None, None
        before, after = zip(*self.losses, strict=True)
        return sum(before) / len(before), sum(after) / len(after)

    def to_dicts(self) -> Rows:
        """One row: the bag, the counts of its clouds, the detector's mean loss, and a column for each kind of
        change to messages, such as `changed`, with their number."""
        before, after = self.mean_losses
        counts = ("frames", "unchanged", "points_clean", "points_adversarial")
        return [
            {
                "bag": str(self.bag),
                **{name: getattr(self, name) for name in counts},
                **{"mean_loss_before": before, "mean_loss_after": after},
                **{what: count for what, count in sorted(self.counts.items()) if count},
            }
        ]

    def __fspath__(self) -> str:
        return str(self.bag)

    def __str__(self) -> str:
        parts = [self._clouds()] if self.frames else []
        if self.replaced:
            parts.append(f"new messages on {', '.join(sorted(self.replaced))}")
            if not self.counts.total():
                parts.append("all as they were")
        parts += [f"{count:,} {what}" for what, count in sorted(self.counts.items()) if count]
        return "\n".join([f"{self.bag}: {'; '.join(parts)}", *self._notes()])

    def _notes(self) -> list[str]:
        """A line for each of the most frequent notes, in alphabetical order."""
        shown = sorted(self.notes.most_common(MAX_NOTES))
        lines = [f"  {count} of {counted(self.frames, 'frame')}: {note}" for note, count in shown]
        rest = self.notes.total() - sum(count for _, count in shown)
        return (
            [*lines, f"  {rest} of {counted(self.frames, 'frame')}: others, see frames.parquet"]
            if rest
            else lines
        )

    def _clouds(self) -> str:
        text = (
            f"{counted(self.frames, 'frame')}, {self.frames - self.unchanged} attacked; "
            f"{counted(self.points_clean, 'point')} became {self.points_adversarial:,}"
        )
        if self.losses:
            before, after = np.mean(self.losses, axis=0)
            text += f"; mean detection loss {before:.3f} became {after:.3f}"
        return text

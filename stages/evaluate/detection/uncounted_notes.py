"""What a report says of labels that count neither way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from advpipe.stages.evaluate.detection.comparison import FrameResult


def uncounted_notes(frames: Sequence[FrameResult]) -> Iterator[str]:
    """How many labelled objects and regions of these frames count neither way, and what the labels cover."""
    of_frames = [frame.truth.uncounted for frame in frames]
    classes = Counter(name for each in of_frames for name in each.boxes.class_names)
    regions = Counter(region.name for each in of_frames for region in each.coverage.ignored)
    views = {region.name for each in of_frames for region in each.coverage.labelled}
    counted = [f"{count} {name}" for name, count in sorted((classes + regions).items())]
    if counted:
        yield f"Labelled, but counted neither way: {', '.join(counted)}."
    if views:
        where = ", ".join(sorted(views))
        yield f"Labels cover only {where}: outside, a detection without a labelled object counts neither way."

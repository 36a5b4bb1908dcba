"""Values as people read them."""

from __future__ import annotations

from advpipe.pipeline.core.text import counted
from advpipe.pipeline.results.metrics import Interval
from advpipe.pipeline.results.records import DefenceRecord
from advpipe.pipeline.results.row import FrameCounts
from advpipe.stages.evaluate.detection.result import MIN_BLOCKS

NOTHING = "–"

ANSWER = {True: "yes", False: "no", None: NOTHING}
"""Whether an attack is significantly stronger."""

UNDEFINED_RATIO = "undefined: nothing found on the clean bag"
"""Stands for a ratio to a clean mAP of 0."""

NOT_MEANINGFUL = "not meaningful"
"""Stands, with the clean mAP, for a ratio to one near 0."""

NO_INTERVAL = "no interval"


def formatted_number(value: object, digits: int, suffix: str = "") -> str:
    """A number with so many digits after the point; a dash for one that is undefined."""
    if not isinstance(value, float | int) or value != value:
        return NOTHING
    return f"{value:,.{digits}f}{suffix}"


def formatted_ratio(percent: object, map_clean: object, digits: int = 2) -> str:
    """A ratio to `map_clean` in percent; in words where that is so low that the ratio is not meaningful."""
    if map_clean == 0 or (isinstance(percent, float) and percent != percent):
        return undefined_ratio(map_clean)
    return formatted_number(percent, digits)


def undefined_ratio(map_clean: object) -> str:
    """What stands for a ratio to a clean mAP of 0 or hardly more."""
    return (
        UNDEFINED_RATIO if map_clean == 0 else f"{NOT_MEANINGFUL}: clean AP {formatted_number(map_clean, 3)}"
    )


def interval(value: object, digits: int = 1) -> str:
    """Such as `40.1…52.3`; a dash where there is none."""
    return f"{value[0]:.{digits}f}…{value[1]:.{digits}f}" if isinstance(value, tuple) else NOTHING


def with_interval(value: object, bounds: object, digits: int = 1) -> str:
    """Such as `46.2 (40.1…52.3)`; the number alone where there is no interval."""
    text = formatted_number(value, digits)
    return f"{text} ({interval(bounds, digits)})" if isinstance(bounds, tuple) else text


def shown_interval(bounds: Interval, counts: FrameCounts) -> Interval:
    """The interval that tables show; None where the frames fill fewer than `MIN_BLOCKS` blocks."""
    return interval_of_blocks(bounds, counts.blocks)


def interval_of_blocks(bounds: Interval, blocks: int) -> Interval:
    """The same of frames that fill this number of blocks."""
    return bounds if blocks >= MIN_BLOCKS else None


def interval_cell(bounds: Interval, counts: FrameCounts | DefenceRecord, digits: int = 1) -> str:
    """Such as `40.1…52.3`; where tables show none, `no interval: 20 frames`."""
    if counts.blocks < MIN_BLOCKS:
        return no_interval(counts)
    return interval(bounds, digits)


def no_interval(counts: FrameCounts | DefenceRecord) -> str:
    """What stands in place of intervals where the frames fill too few blocks for one."""
    return f"{NO_INTERVAL}: {counted(counts.frames, 'frame')}"


def short_name(detector: object) -> str:
    """A detector's name where there is little room: the class alone of `module:Class`."""
    return str(detector).rpartition(":")[2]

"""What a bag of advpipe says beyond other recordings: what does not count, names of frames, the licence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.bag.recorded_source import RecordedSource, read_source
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.regions import LabelCoverage
from advpipe.pipeline.messages.labels import IgnoredBoxes, coverage_from_message
from advpipe.stages.import_.named_boxes import NamedBox
from advpipe.stages.import_.rosbag.recording import Recording
from advpipe.stages.import_.rosbag.topics import ChosenTopics


class Uncounting(NamedTuple):
    """The messages about what does not count at one instant, each None where there is none."""

    ignored: Any = None
    coverage: Any = None


def source_of_bag(recording: Recording) -> RecordedSource:
    """Where a bag that was imported comes from; without values for any other recording.

    Raises AdvpipeError for a damaged record.
    """
    found = read_source(recording.path) if recording.provenance else None
    return found or RecordedSource()


def frame_names(recording: Recording, topics: ChosenTopics) -> Mapping[int, str]:
    """The source's names of frames by the time at which their clouds were recorded."""
    if topics.frame_names is None:
        return {}
    recorded = recording.messages([topics.frame_names])
    return {each.log_time_ns: str(recording.decode(each).data) for each in recorded}


def ignored_boxes(named: Sequence[NamedBox]) -> IgnoredBoxes:
    """Boxes that count neither way, as they are named."""
    geometry = np.array([each.box for each in named], np.float64).reshape(-1, 7)
    return IgnoredBoxes(geometry, tuple(each.class_name for each in named), tuple(each.id for each in named))


def coverage_of(message: Any) -> LabelCoverage:
    """Where objects are labelled, in the frame of the message. Raises AdvpipeError for incomplete planes."""
    try:
        return coverage_from_message(message)
    except ValueError as error:
        raise AdvpipeError(f"the message about the labelled regions is damaged: {error}") from None

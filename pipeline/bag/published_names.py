"""Under which names a bag's topics are published, as the scenario in it says."""

from __future__ import annotations

from pydantic import Field

from advpipe.pipeline.bag.latched import latched_text
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import Document, ShortText, read_json
from advpipe.pipeline.messages.topic_names import ADVPIPE, PUBLISHED_NAMES
from advpipe.pipeline.messages.topics import SCENARIO_INFO


class _Recording(Document):
    names: ShortText = ADVPIPE


class _Recorded(Document):
    recording: _Recording = Field(default_factory=_Recording)


def published_names(reader: BagReader) -> str:
    """The scenario's `recording.names`; advpipe's own for a bag without a scenario, or of a later release.

    Raises AdvpipeError for a scenario that cannot be read.
    """
    info = reader.topics.get(SCENARIO_INFO.name)
    if info is None or not info.count or info.type != SCENARIO_INFO.type:
        return ADVPIPE
    where = f"{reader.path}: {SCENARIO_INFO.name} holds no scenario"
    names = read_json(latched_text(reader, SCENARIO_INFO.name), _Recorded, where, "record it again")
    return names.recording.names if names.recording.names in PUBLISHED_NAMES else ADVPIPE

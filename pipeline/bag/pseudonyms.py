"""Which station took which pseudonym, as a bag's ground truth says."""

from __future__ import annotations

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import V2X_PSEUDONYMS
from advpipe.pipeline.messages.v2x import PseudonymUse


def read_pseudonyms(reader: BagReader, last_ns: int | None = None) -> list[PseudonymUse]:
    """All changes of pseudonyms in the order of time; none in a bag without any.

    The first pseudonym of a station is its radio's number, and is not listed.
    """
    if V2X_PSEUDONYMS.name not in reader.topics:
        return []
    found = reader.messages(V2X_PSEUDONYMS.name, last_ns)
    return [PseudonymUse(build.stamp_ns(one), int(one.station_id), int(one.pseudonym)) for _, one in found]


def radios_by_pseudonym(reader: BagReader) -> dict[int, int]:
    """The number of a station's radio by its later pseudonyms."""
    return {one.pseudonym: one.station_id for one in read_pseudonyms(reader)}

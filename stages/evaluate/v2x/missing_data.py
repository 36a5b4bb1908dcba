"""The V2X data that a bag lacks, and what therefore is not evaluated rather than guessed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.stages.evaluate.v2x.receptions import ListenerReceptions


def missing_data(
    reader: BagReader, receptions: Sequence[ListenerReceptions], has_labels: bool
) -> Iterator[str]:
    """A sentence for each topic that is missing, none for a bag that `simulate` and `attack` make.

    has_labels: whether the bag has attackers, so that it matters who truly sent what.
    """
    for each in receptions:
        topics, unknown = VehicleTopics(each.listener), each.numbers.count(None)
        if unknown and has_labels:
            yield (
                f"which sent messages {unknown:,} of the {len(each.numbers):,} that {each.listener} received "
                f"truly were is not known ({topics.true_receptions.name}), so they are not scored; "
                "record the drive again with this version."
            )
        if topics.ldm.name not in reader.topics:
            yield f"{each.listener} recorded no map ({topics.ldm.name}), so its map is not evaluated."
    if V2X_STATIONS.name not in reader.topics:
        yield f"where the stations truly were is not known ({V2X_STATIONS.name}), so no map is evaluated."
    if V2X_SENT.name not in reader.topics:
        yield f"what others sent is not known ({V2X_SENT.name}), so the share delivered is not counted."

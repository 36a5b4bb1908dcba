"""What a bag does not tell of its V2X, and what therefore is not evaluated: it is said, and not guessed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.stages.evaluate.v2x.receptions import ListenerReceptions


def untold(reader: BagReader, receptions: Sequence[ListenerReceptions], has_labels: bool) -> Iterator[str]:
    """A sentence for each topic that is missing, none for a bag that `simulate` and `attack` make.

    has_labels: whether somebody lies in the bag, so that it matters who truly sent what.
    """
    for each in receptions:
        topics, unknown = VehicleTopics(each.listener), each.numbers.count(None)
        if unknown and has_labels:
            yield (
                f"which sent messages {unknown:,} of the {len(each.numbers):,} that {each.listener} received "
                f"truly were is not known ({topics.true_receptions.name}), so they are not scored; a drive "
                "recorded again with this version tells."
            )
        if topics.ldm.name not in reader.topics:
            yield f"{each.listener} recorded no map ({topics.ldm.name}), so nothing is said of it."
    if V2X_STATIONS.name not in reader.topics:
        yield f"where the stations truly were is not known ({V2X_STATIONS.name}), so no map is judged."
    if V2X_SENT.name not in reader.topics:
        yield f"what others sent is not known ({V2X_SENT.name}), so the share delivered is not counted."

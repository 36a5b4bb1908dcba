"""The V2X data that a bag lacks, and what is therefore not evaluated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.stages.evaluate.v2x.receptions import ListenerReceptions


def missing_data(
    reader: BagReader, receptions: Sequence[ListenerReceptions], has_labels: bool
) -> Iterator[str]:
    """A sentence for each missing topic; none for a bag made by `simulate` and `attack`.

    has_labels: whether the bag has attackers, so that true senders matter.
    """
    for each in receptions:
        topics, unknown = VehicleTopics(each.listener), each.numbers.count(None)
        if unknown and has_labels:
            yield (
                f"{unknown:,} of the {len(each.numbers):,} messages that {each.listener} received are not "
                f"scored: their true senders are not recorded ({topics.true_receptions.name}); record the "
                "drive again with this version."
            )
        if topics.ldm.name not in reader.topics:
            yield f"the map of {each.listener} is not evaluated: it is not recorded ({topics.ldm.name})."
    if V2X_STATIONS.name not in reader.topics:
        yield f"no map is evaluated: true positions of stations are not recorded ({V2X_STATIONS.name})."
    if V2X_SENT.name not in reader.topics:
        yield f"no share of delivered messages: sent messages are not recorded ({V2X_SENT.name})."

"""Whether advpipe's topics have the type and quality of service of the topic table."""

from __future__ import annotations

from collections.abc import Iterator

from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.messages import topics
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Result

_GLOBAL = {topic.name: topic for topic in vars(topics).values() if isinstance(topic, Topic)}
_OF_VEHICLES = [name for name, member in vars(VehicleTopics).items() if isinstance(member, property)]


class QualityOfService(BagCheck):
    """Checks advpipe's bags only."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_own:
            return
        for scanner in self.bag.scanners:
            for topic in scanner.topics.values():
                known = known_topic(topic.name)
                if known is not None and topic.type != known.type:
                    yield Fault(f"{self.bag.place} {topic.name}", f"is a {topic.type}, not a {known.type}")
                elif known is not None and topic.qos != known.qos:
                    yield Fault(
                        f"{self.bag.place} {topic.name}", "offers a QoS that differs from the topic table's"
                    )


def known_topic(name: str) -> Topic | None:
    """The topic of this name in the table; None for a user's topic."""
    if name in _GLOBAL:
        return _GLOBAL[name]
    vehicle, _, rest = name.removeprefix("/").partition("/")
    own = VehicleTopics(vehicle, rest.partition("/")[0])
    values = (getattr(own, member) for member in _OF_VEHICLES)
    return next((topic for topic in values if isinstance(topic, Topic) and topic.name == name), None)

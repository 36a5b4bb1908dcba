"""The attacks in an adversarial bag's provenance, and the messages that it may contain."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_cameras import cameras_of
from advpipe.pipeline.bag.recorded_radars import recorded_radars
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.labels import fixes, images, scans
from advpipe.pipeline.labels.clouds import FRAMES
from advpipe.pipeline.labels.declaration import Family
from advpipe.pipeline.labels.quantity import Quantity, Range
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.qos import is_latched
from advpipe.pipeline.messages.topics import (
    TF,
    V2X_PACKETS,
    V2X_SENT,
    V2X_STATIONS,
    V2X_STATISTICS,
    VehicleTopics,
)
from advpipe.pipeline.scenario.acting import Acting, acting_on_messages
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.message_type import MESSAGE_TYPES
from advpipe.stages.verify.attackers import MessageAttack
from advpipe.stages.verify.declared_bounds import measurable
from advpipe.stages.verify.subject import BagUnderTest


class AttackedBag:
    """An adversarial bag and its parent. Raises AdvpipeError or ValueError for unreadable provenance."""

    def __init__(self, bag: BagUnderTest, parent: BagUnderTest) -> None:
        self.bag, self.clean, self.adversarial = bag, parent.reader, bag.reader
        self.attacks = bag.provenance.fields.attacks
        families = {attack.family for attack in self.attacks}
        self.has_clouds = "lidar" in families
        self.has_messages = bool(families - {"lidar"})
        self.has_v2x = bool(families & {"v2x", "gnss"})  # messages carry what the receiver says

    @cached_property
    def on_messages(self) -> tuple[MessageAttack, ...]:
        """The attacks on messages and fixes; raises ValueError for attacks that this version does not
        know."""
        return tuple(
            MessageAttack(
                AttackSpec.model_validate(
                    {key: value for key, value in attack.values.items() if key in AttackSpec.model_fields}
                ),
                attack.family,
                attack.declared,
            )
            for attack in self.attacks
            if attack.family != "lidar"
        )

    def of_family(self, family: Family) -> list[MessageAttack]:
        """The attacks of one family."""
        return [attack for attack in self.on_messages if attack.family == family]

    def acts(
        self, attacks: Iterable[MessageAttack], quantities: Mapping[str, Quantity[Any]]
    ) -> dict[str, tuple[Acting, Mapping[str, Range]]]:
        """When each may act, and the bounds that it declares on these quantities, by its name."""
        return {
            each.spec.type: (
                acting_on_messages(each.spec, self.start_ns, self.seed),
                measurable(each.declared.bounds, quantities) if each.declared else {},
            )
            for each in attacks
        }

    @property
    def seed(self) -> int:
        """The attack's seed; raises ValueError if the bag does not record it."""
        seed = self.bag.provenance.fields.seed
        if seed is None:
            raise ValueError("its provenance records no seed")
        return seed

    @cached_property
    def start_ns(self) -> int:
        """The start of the clean bag, from which schedules count."""
        times_of_topics = (self.clean.log_times_ns(name) for name in self.clean.topics)
        return min((int(times_ns[0]) for times_ns in times_of_topics if len(times_ns)), default=0)

    def table(self, name: str) -> Path:
        """The path of a label table of the bag."""
        return self.bag.path / name

    @cached_property
    def cloud_topics(self) -> tuple[str, ...]:
        """The topics whose clouds an attack may have changed; frames are counted on the first one."""
        if not self.has_clouds:
            return ()
        if "lidar_topics" in self.bag.provenance:
            found = list(self.bag.provenance.fields.lidar_topics)
        else:
            stated = rows(self.table(FRAMES), ["topic"])
            found = [topic for topic, _ in groupby(row["topic"] for row in stated)]
        first = next(attack for attack in self.attacks if attack.family == "lidar")
        leading = first.lidar or VehicleTopics(first.victim or "ego").lidar_points.name
        return tuple(sorted(dict.fromkeys(found), key=lambda name: name != leading))

    @cached_property
    def replaced(self) -> frozenset[str]:
        """The topics that attacks on messages may have rewritten."""
        names: set[str] = set()
        victims: set[str] = set()
        if self.table(fixes.FILE).is_file():
            victims = {row["vehicle"] for row in rows(self.table(fixes.FILE), ["vehicle"])}
        for victim in map(VehicleTopics, victims):
            names |= {victim.gnss_fix.name, victim.odometry.name, TF.name}
        if self.table(scans.FILE).is_file():
            labelled = {row["topic"] for row in rows(self.table(scans.FILE), ["topic"])}
            touched = [one for one in recorded_radars(self.clean) if one.scan_topic in labelled]
            names |= {topic for one in touched for topic in (one.scan_topic, one.points_topic)}
        if self.table(images.FILE).is_file():
            labelled = {row["topic"] for row in rows(self.table(images.FILE), ["topic"])}
            names |= labelled & {one.image_topic for one in cameras_of(self.clean)}
        if self.has_v2x:
            vehicles = {name.split("/")[1] for name in self.clean.topics if name.count("/") > 1}
            names |= {V2X_SENT.name, V2X_PACKETS.name, V2X_STATIONS.name, V2X_STATISTICS.name}
            for own in map(VehicleTopics, vehicles):
                kinds = MESSAGE_TYPES.values()
                topics = own.sent_raw, *map(own.sent_values, kinds), *map(own.received_values, kinds)
                beside = own.received_raw, own.reception_info, own.true_receptions, own.rejections
                names |= {
                    topic.name for topic in (*topics, *beside, own.ldm, own.ldm_objects, own.heard_objects)
                }
        return frozenset(names)

    @cached_property
    def frames(self) -> tuple[range, npt.NDArray[np.int64]] | None:
        """The frames in the bag, and the times of all clouds on which they are counted; None for all."""
        if not self.has_clouds or not self.cloud_topics:
            return None
        times_ns = self.clean.log_times_ns(self.cloud_topics[0])
        return FrameSlice.parse(self.bag.provenance.get("frames", "::")).indices(len(times_ns)), times_ns

    def kept(self, messages: Iterator[RawMessage]) -> Iterator[RawMessage]:
        """The clean bag's messages, in log-time order, that belong to the adversarial bag's frames.

        A message belongs to the latest cloud at or before it, or to the first. If messages are attacked
        too, only clouds are dropped. Latched topics other than those of the clouds are kept completely.
        """
        if self.frames is None:
            yield from messages
            return
        frames, times_ns = self.frames
        latched = latched_topics(self.clean) - {*self.cloud_topics}
        index = 0
        for raw in messages:
            name = raw.topic.name
            if name == self.cloud_topics[0]:
                index += 1
                if index - 1 in frames:
                    yield raw
                continue
            is_cloud = name in self.cloud_topics
            latest = max(int(np.searchsorted(times_ns, raw.log_time_ns, side="right")) - 1, 0)
            if name in latched or (self.has_messages and not is_cloud) or latest in frames:
                yield raw


def latched_topics(reader: BagReader) -> frozenset[str]:
    """The topics with transient-local durability."""
    return frozenset(name for name, info in reader.topics.items() if is_latched(info.qos))

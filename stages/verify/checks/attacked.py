"""What an adversarial bag says was done to its parent, and which messages it may hold."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import groupby
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.labels import fixes
from advpipe.pipeline.labels.clouds import FRAMES
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.topics import TF, V2X_SENT, V2X_STATIONS, V2X_STATISTICS, VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.verify.attackers import MessageAttack
from advpipe.stages.verify.subject import Bag


class AttackedBag:
    """An attack and its parent. Raises AdvpipeError or ValueError where what the bag says cannot be read."""

    def __init__(self, bag: Bag, parent: Bag) -> None:
        self.bag, self.clean, self.adversarial = bag, parent.reader, bag.reader
        self.attacks = bag.provenance.fields.attacks
        families = {one.family for one in self.attacks}
        self.has_clouds = "lidar" in families
        self.has_messages = bool(families - {"lidar"})

    @cached_property
    def on_messages(self) -> tuple[MessageAttack, ...]:
        """The attacks on messages and fixes; ValueError where they are none of this version."""
        return tuple(
            MessageAttack(
                AttackSpec.model_validate(
                    {key: value for key, value in one.values.items() if key in AttackSpec.model_fields}
                ),
                one.family,
                one.declared,
            )
            for one in self.attacks
            if one.family != "lidar"
        )

    @property
    def seed(self) -> int:
        seed = self.bag.provenance.fields.seed
        if seed is None:
            raise ValueError("its provenance records no seed")
        return seed

    @cached_property
    def start_ns(self) -> int:
        """When the clean bag begins: what schedules count from."""
        times_ns = (self.clean.log_times_ns(name) for name in self.clean.topics)
        return min((int(one[0]) for one in times_ns if len(one)), default=0)

    def table(self, name: str) -> Path:
        return self.bag.path / name

    @cached_property
    def cloud_topics(self) -> tuple[str, ...]:
        """The topics whose clouds an attack may have changed, the one that counts the frames first."""
        if not self.has_clouds:
            return ()
        if "lidar_topics" in self.bag.provenance:
            found = list(self.bag.provenance.fields.lidar_topics)
        else:
            stated = rows(self.table(FRAMES), ["topic"])
            found = [topic for topic, _ in groupby(row["topic"] for row in stated)]
        first = next(one for one in self.attacks if one.family == "lidar")
        leading = first.lidar or VehicleTopics(first.victim or "ego").lidar_points.name
        return tuple(sorted(dict.fromkeys(found), key=lambda name: name != leading))

    @cached_property
    def replaced(self) -> frozenset[str]:
        """The topics that attacks on messages may have written anew."""
        names: set[str] = set()
        victims: set[str] = set()
        if self.table(fixes.FILE).is_file():
            victims = {row["vehicle"] for row in rows(self.table(fixes.FILE), ["vehicle"])}
        for victim in map(VehicleTopics, victims):
            names |= {victim.gnss_fix.name, victim.odometry.name, TF.name}
        if self.has_messages:
            vehicles = {name.split("/")[1] for name in self.clean.topics if name.count("/") > 1}
            names |= {V2X_SENT.name, V2X_STATIONS.name, V2X_STATISTICS.name}
            for own in map(VehicleTopics, vehicles):
                topics = own.sent_raw, own.sent_cam, own.received_raw, own.received_cam
                beside = own.reception_info, own.true_receptions
                names |= {topic.name for topic in (*topics, *beside, own.ldm, own.ldm_objects)}
        return frozenset(names)

    @cached_property
    def frames(self) -> tuple[range, npt.NDArray[np.int64]] | None:
        """The frames that the bag holds, and the times of all clouds that count them; None for all."""
        if not self.has_clouds or not self.cloud_topics:
            return None
        times_ns = self.clean.log_times_ns(self.cloud_topics[0])
        return FrameSlice.parse(self.bag.provenance.get("frames", "::")).indices(len(times_ns)), times_ns

    def kept(self, messages: Iterator[RawMessage]) -> Iterator[RawMessage]:
        """Those of the clean bag's messages, in log-time order, that belong to the bag's frames.

        A message belongs to the latest cloud at or before it, or to the first. Where messages are attacked
        too, only clouds are left out. Latched topics are kept whole.
        """
        if self.frames is None:
            yield from messages
            return
        frames, times_ns = self.frames
        latched = latched_topics(self.clean)
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
    from rosbags.interfaces import QosDurability

    return frozenset(
        name
        for name, info in reader.topics.items()
        if any(qos.durability is QosDurability.TRANSIENT_LOCAL for qos in info.qos)
    )

"""A node of a ROS 2 graph: a participant of a DDS domain that says which topics are whose."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic as DdsTopic
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from advpipe.pipeline.live.dds_domain import DdsDomain
from advpipe.pipeline.live.dds_types import DdsType
from advpipe.pipeline.live.offered_qos import OfferedQos
from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.live.writer_qos import writer_qos
from advpipe.pipeline.mcap.channel import Topic

NODE_NAME = "advpipe"

DISCOVERY_INFO = "ros_discovery_info"
"""The DDS topic on which every ROS 2 participant announces its nodes (rmw_dds_common)."""

_INFO_TYPE = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_WITH_LONG_IDS = ("foxy", "galactic", "humble")
"""Distributions whose identifiers of entities have 24 bytes, filled up with zeros; later ones have 16."""

_INFO_SCHEMA = """rmw_dds_common/Gid gid
rmw_dds_common/NodeEntitiesInfo[] node_entities_info_seq
================================================================================
MSG: rmw_dds_common/NodeEntitiesInfo
string<=256 node_namespace
string<=256 node_name
rmw_dds_common/Gid[] reader_gid_seq
rmw_dds_common/Gid[] writer_gid_seq
================================================================================
MSG: rmw_dds_common/Gid
char[{id_bytes}] data
"""


class Ros2Node:
    """Joins a domain under a name that `ros2 node list` shows, beside the topics of its readers and writers.

    domain_id: ROS_DOMAIN_ID of the graph. interface: of the network; None for the one that ROS 2 would take.
    The announcement has the form of the distribution that ROS_DISTRO names, of the newest ones without it.
    """

    def __init__(self, domain_id: int = 0, interface: str | None = None, name: str = NODE_NAME) -> None:
        self.domain_id, self.name = domain_id, name
        self._id_bytes = 24 if os.environ.get("ROS_DISTRO", "").lower() in _WITH_LONG_IDS else 16
        self._domain = DdsDomain(domain_id, interface)
        self.participant = self._domain.participant
        schema = _INFO_SCHEMA.format(id_bytes=self._id_bytes)
        self._store = Typestore()
        self._store.register(get_types_from_msg(schema, _INFO_TYPE))
        self._kind = DdsType(PublishedTopic(Topic(DISCOVERY_INFO, _INFO_TYPE), schema))
        offered = OfferedQos(depth=1, is_reliable=True, is_latched=True)
        topic = DdsTopic(self.participant, DISCOVERY_INFO, self._kind.struct)
        self._writer: Any = DataWriter(self.participant, topic, qos=writer_qos(offered, self._kind.hash))
        self._readers: list[Any] = []
        self._writers: list[Any] = []
        self._announce()

    def add_reader(self, reader: Any) -> None:
        """Announce a DDS reader as the node's subscription."""
        self._readers.append(self._gid(reader))
        self._announce()

    def add_writer(self, writer: Any) -> None:
        """Announce a DDS writer as the node's publisher."""
        self._writers.append(self._gid(writer))
        self._announce()

    def close(self) -> None:
        """Leave the domain; all readers and writers in it end."""
        del self.participant, self._writer
        self._domain.close()

    def _gid(self, entity: Any) -> Any:
        """The DDS identifier of an entity, as ROS 2 writes it."""
        data = entity.guid.bytes.ljust(self._id_bytes, b"\0")
        return self._message("Gid", data=np.frombuffer(data, np.uint8))

    def _announce(self) -> None:
        node = self._message(
            "NodeEntitiesInfo",
            node_namespace="/",
            node_name=self.name,
            reader_gid_seq=list(self._readers),
            writer_gid_seq=list(self._writers),
        )
        info = self._message(
            "ParticipantEntitiesInfo", gid=self._gid(self.participant), node_entities_info_seq=[node]
        )
        self._writer.write(self._kind.sample(bytes(self._store.serialize_cdr(info, _INFO_TYPE))))

    def _message(self, name: str, **fields: Any) -> Any:
        return self._store.types[f"rmw_dds_common/msg/{name}"](**fields)

"""The file of `advpipe relay`: what is relayed, and which attacks change it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, StringConstraints, model_validator

from advpipe.pipeline.core.document import read_text, read_yaml
from advpipe.pipeline.core.errors import as_usage_error
from advpipe.pipeline.core.section import Number, Section, Whole
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.scenario.attacks import AttackSpec, BagAttacks
from advpipe.pipeline.scenario.map import GeoOrigin
from advpipe.pipeline.scenario.schema import DIALECT

PASS, DROP = "pass", "drop"

TopicName = Annotated[str, StringConstraints(pattern=r"^(/[A-Za-z_][A-Za-z0-9_]*)+$", max_length=200)]

_EGO = VehicleTopics("ego")


class RelaySettings(Section):
    """Topics are relayed where an attack of their family is listed."""

    attacks: BagAttacks = Field(description="attacks, as in a scenario file; a single one needs no list")
    seed: Whole = Field(0, ge=0, lt=2**63, description="seed of all random draws")
    cloud_topic: TopicName = Field(
        _EGO.lidar_points.name, description="clouds, of type sensor_msgs/msg/PointCloud2"
    )
    packet_topic: TopicName | Literal[""] = Field(
        _EGO.received_raw.name,
        description="received CAMs in BTP-B packets, of type udp_msgs/msg/UdpPacket; empty for a graph that "
        "has CAMs as etsi_its_cam_msgs/msg/CAM alone",
    )
    cam_topic: TopicName | Literal[""] = Field(
        _EGO.received_cam.name,
        description="where the same CAMs are published as etsi_its_cam_msgs/msg/CAM, too; empty for nowhere. "
        "Without packet_topic, where they are received",
    )
    fix_topic: TopicName = Field(
        _EGO.gnss_fix.name, description="GPS fixes, of type sensor_msgs/msg/NavSatFix"
    )
    origin: GeoOrigin | None = Field(
        None, description="geographic origin of the map frame; by default the first position that is received"
    )
    max_latency_s: Number = Field(
        0.2, gt=0, le=60, description="longest time for which a cloud waits for its attack"
    )
    when_late: Literal["pass", "drop"] = Field(
        "pass",
        description="what becomes of a cloud whose attack takes longer, or that comes while another one is "
        "attacked: it passes unchanged, or is dropped",
    )

    @model_validator(mode="after")
    def _only_what_a_relay_can(self) -> RelaySettings:
        if not self.packet_topic and not self.cam_topic:
            raise ValueError("packet_topic and cam_topic are both empty; name the one that the graph has")
        topics = [self.cloud_topic, self.packet_topic, self.cam_topic, self.fix_topic]
        if len(set(topics)) < len(topics):
            raise ValueError("two of the topics are the same")
        for spec in self.attacks:
            for key in ("lidar", "frames", "dcc_reacts", "network"):
                if getattr(spec, key) != AttackSpec.model_fields[key].default:
                    raise ValueError(f"{spec.type}: a relay has no use for {key}; leave it out")
        return self


def vehicle_of(topic_name: str) -> str:
    """The vehicle whose topic it is: the first part of its name."""
    return topic_name.strip("/").partition("/")[0]


def load_relay_settings(path: Path) -> RelaySettings:
    """Raises UsageError, one line, for a file that cannot be read or has a wrong key."""
    with as_usage_error():
        found: RelaySettings = read_yaml(
            read_text(path), RelaySettings, str(path), "`advpipe schema --of relay` describes all keys"
        )
    return found


def relay_schema_json() -> str:
    """The JSON Schema of the file, as an indented text."""
    schema: dict[str, Any] = RelaySettings.model_json_schema()
    return json.dumps({"$schema": DIALECT, **schema, "title": "advpipe relay"}, indent=2, ensure_ascii=False)

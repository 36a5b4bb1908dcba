"""The quality of service that a topic's publishers offer, as rosbag2 keeps it in a channel's metadata."""

from __future__ import annotations

from typing import Annotated

import yaml
from pydantic import Field, TypeAdapter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from advpipe.pipeline.core import plain_yaml
from advpipe.pipeline.core.document import Count, Document, Word
from advpipe.pipeline.core.errors import one_line

_FOREVER = QosTime(9223372036, 854775807)


def keep_last(depth: int, *, reliable: bool = True, latched: bool = False) -> tuple[Qos, ...]:
    """The quality of service of a topic that keeps its newest `depth` messages for slow subscribers.

    latched: subscribers that come later also get them (transient local).
    """
    return (
        Qos(
            history=QosHistory.KEEP_LAST,
            depth=depth,
            reliability=QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
            durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
            deadline=_FOREVER,
            lifespan=_FOREVER,
            liveliness=QosLiveliness.AUTOMATIC,
            liveliness_lease_duration=_FOREVER,
            avoid_ros_namespace_conventions=False,
        ),
    )


class _Time(Document):
    sec: Count
    nsec: Count


class _Profile(Document):
    """As rosbag2 writes one; enumerations by number or name."""

    history: Count | Word
    depth: Count
    reliability: Count | Word
    durability: Count | Word
    deadline: _Time
    lifespan: _Time
    liveliness: Count | Word
    liveliness_lease_duration: _Time
    avoid_ros_namespace_conventions: bool


_PROFILES = TypeAdapter(Annotated[list[_Profile], Field(max_length=1000)] | None)


def qos_to_yaml(profiles: tuple[Qos, ...]) -> str:
    """The profiles on one line, enumerations as numbers: what every rosbag2 since Foxy reads."""
    plain = [
        {
            "history": qos.history.value,
            "depth": qos.depth,
            "reliability": qos.reliability.value,
            "durability": qos.durability.value,
            "deadline": qos.deadline._asdict(),
            "lifespan": qos.lifespan._asdict(),
            "liveliness": qos.liveliness.value,
            "liveliness_lease_duration": qos.liveliness_lease_duration._asdict(),
            "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
        }
        for qos in profiles
    ]
    return yaml.safe_dump(plain, default_flow_style=True, sort_keys=False, width=10**9).strip()


def qos_from_yaml(text: str) -> tuple[Qos, ...]:
    """The profiles in a channel's metadata, with numbers (to Iron) or names (from Jazzy).

    Raises ValueError for a text that is none.
    """
    try:
        profiles = _PROFILES.validate_python(plain_yaml.load_yaml(text)) or ()
        return tuple(parse_qos([profile.model_dump() for profile in profiles]))  # type: ignore[misc]
    except (yaml.YAMLError, ValueError, ReaderError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(f"offered_qos_profiles: {one_line(error)[:200]}") from None

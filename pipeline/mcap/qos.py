"""The quality of service (QoS) that a topic's publishers offer, as rosbag2 stores it in channel metadata."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import yaml
from pydantic import Field, TypeAdapter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos

from advpipe.pipeline.core import plain_yaml
from advpipe.pipeline.core.document import Count, Document, ShortText
from advpipe.pipeline.core.errors import one_line

_FOREVER = QosTime(9223372036, 854775807)


def keep_last(depth: int, *, reliable: bool = True, latched: bool = False) -> tuple[Qos, ...]:
    """The QoS profile that keeps the newest `depth` messages of a topic for slow subscribers.

    reliable: lost messages are sent again. latched: late subscribers receive the last messages.
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


def is_latched(profiles: Iterable[Qos]) -> bool:
    """Whether late subscribers receive the last messages of one of these publishers."""
    return any(profile.durability == QosDurability.TRANSIENT_LOCAL for profile in profiles)


class _Time(Document):
    sec: Count
    nsec: Count


class _Profile(Document):
    """A profile as rosbag2 writes it, with enumerations as numbers or names."""

    history: Count | ShortText
    depth: Count
    reliability: Count | ShortText
    durability: Count | ShortText
    deadline: _Time
    lifespan: _Time
    liveliness: Count | ShortText
    liveliness_lease_duration: _Time
    avoid_ros_namespace_conventions: bool


_PROFILES = TypeAdapter(Annotated[list[_Profile], Field(max_length=1000)] | None)


def qos_to_yaml(profiles: tuple[Qos, ...]) -> str:
    """The profiles as one line of YAML with enumerations as numbers, which every rosbag2 since Foxy reads."""
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
    """Parse the profiles in channel metadata; enumerations are numbers (up to Iron) or names (from Jazzy).

    Raises ValueError for an invalid text.
    """
    try:
        profiles = _PROFILES.validate_python(plain_yaml.load_yaml(text)) or ()
        return tuple(parse_qos([profile.model_dump() for profile in profiles]))  # type: ignore[misc]
    except (yaml.YAMLError, ValueError, ReaderError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(f"offered_qos_profiles: {one_line(error)[:200]}") from None

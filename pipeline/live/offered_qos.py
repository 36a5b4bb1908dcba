"""The quality of service under which a bag's topic is published again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rosbags.interfaces import Qos, QosHistory, QosLiveliness, QosReliability, QosTime

from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.qos import is_latched, keep_last
from advpipe.pipeline.messages.topics import TF_STATIC

MOST_KEPT = 1000
"""The deepest history that is kept for slow subscribers, which bounds memory."""

_DEFAULT_DEPTH = 10
_UNLIMITED_NS = 2**63 - 1
"""As ROS 2 writes a duration without an end."""


@dataclass(frozen=True)
class OfferedQos:
    """What a publisher offers; durations in nanoseconds, None without an end.

    depth: messages that are kept for slow subscribers. is_latched: late subscribers receive these.
    liveliness: how publishers show that they are alive, with the lease.
    """

    depth: int
    is_reliable: bool
    is_latched: bool
    deadline_ns: int | None = None
    lifespan_ns: int | None = None
    liveliness: QosLiveliness = QosLiveliness.AUTOMATIC
    lease_ns: int | None = None


def offered_qos(topic: Topic) -> OfferedQos:
    """The QoS with which every subscriber that received the recorded topic can receive it again.

    Where its publishers differed, the strongest of their offers. Without any offer, that of ROS 2: reliable,
    the last ten, and latched for /tf_static.
    """
    profiles = topic.qos or (TF_STATIC.qos if topic.name == TF_STATIC.name else keep_last(_DEFAULT_DEPTH))
    kinds = {profile.liveliness for profile in profiles} - {
        QosLiveliness.SYSTEM_DEFAULT,
        QosLiveliness.UNKNOWN,
        QosLiveliness.BEST_AVAILABLE,
    }
    return OfferedQos(
        depth=max(map(_depth, profiles)),
        is_reliable=any(profile.reliability != QosReliability.BEST_EFFORT for profile in profiles),
        is_latched=is_latched(profiles),
        deadline_ns=_shortest(profile.deadline for profile in profiles),
        lifespan_ns=_longest([profile.lifespan for profile in profiles]),
        liveliness=max(kinds, key=lambda kind: kind.value, default=QosLiveliness.AUTOMATIC),
        lease_ns=_shortest(profile.liveliness_lease_duration for profile in profiles),
    )


def _depth(profile: Qos) -> int:
    if profile.history == QosHistory.KEEP_ALL:
        return MOST_KEPT
    return min(profile.depth, MOST_KEPT) or _DEFAULT_DEPTH


def _duration_ns(time: QosTime) -> int | None:
    """ROS 2 writes an unlimited duration as the longest one, or as zero for "not set"."""
    duration_ns = time.sec * 10**9 + time.nsec
    return None if duration_ns == 0 or duration_ns >= _UNLIMITED_NS else duration_ns


def _shortest(times: Iterable[QosTime]) -> int | None:
    return min((ns for ns in map(_duration_ns, times) if ns is not None), default=None)


def _longest(times: Sequence[QosTime]) -> int | None:
    durations_ns = [_duration_ns(time) for time in times]
    return None if None in durations_ns else max(ns for ns in durations_ns if ns is not None)

"""The quality of service of a DDS writer."""

from __future__ import annotations

from cyclonedds.qos import Policy, Qos
from cyclonedds.util import duration
from rosbags.interfaces import QosLiveliness

from advpipe.pipeline.live.offered_qos import OfferedQos

BLOCK_S = 0.02
"""How long a reliable writer waits for a slow subscriber before a message is dropped."""


def writer_qos(offered: OfferedQos, type_hash: str) -> Qos:
    """The QoS of a DDS writer; its user data has the type's hash, where ROS 2 from Iron on looks for it."""
    history = Policy.History.KeepLast(offered.depth)
    policies = [
        history,
        Policy.Reliability.Reliable(duration(seconds=BLOCK_S))
        if offered.is_reliable
        else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if offered.is_latched else Policy.Durability.Volatile,
        Policy.WriterDataLifecycle(autodispose=False),  # as ROS 2: what was sent stays valid
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"typehash={type_hash};".encode()),
    ]
    if offered.is_latched:  # what late subscribers receive
        policies.append(Policy.DurabilityService(0, history, -1, -1, -1))
    if offered.deadline_ns is not None:
        policies.append(Policy.Deadline(offered.deadline_ns))
    if offered.lifespan_ns is not None:
        policies.append(Policy.Lifespan(offered.lifespan_ns))
    if offered.liveliness == QosLiveliness.MANUAL_BY_TOPIC:
        policies.append(Policy.Liveliness.ManualByTopic(_lease(offered)))
    elif offered.lease_ns is not None:
        policies.append(Policy.Liveliness.Automatic(offered.lease_ns))
    return Qos(*policies)


def _lease(offered: OfferedQos) -> int:
    return duration(infinite=True) if offered.lease_ns is None else offered.lease_ns

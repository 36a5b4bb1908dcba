"""The messages of an adversarial bag: of the changed drive, those of the chosen frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from rosbags.interfaces import QosDurability

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.stages.attack.clouds import CloudPlan


def messages_of_frames(
    reader: BagReader, messages: Iterable[RawMessage], plan: CloudPlan, *, clouds_only: bool
) -> Iterator[tuple[int | None, RawMessage]]:
    """Each message of the plan's frames, with its index in the clean bag if it is a cloud of its topics.

    messages: those of the whole drive in log-time order. clouds_only: whether only clouds of these
    topics are left out, and all else is kept. Latched topics (/tf_static, /scenario/info) are kept whole:
    those from before the first chosen frame are logged at its time, so that the bag does not begin with a
    long silence.
    """
    is_cut = not clouds_only and plan.frames[0] > 0
    start_ns = int(plan.times_ns[plan.frames[0]]) if is_cut else 0
    latched = {name for name, info in reader.topics.items() if _is_latched(info.qos)}
    counts = dict.fromkeys(plan.topics, 0)
    early: list[RawMessage] = []
    for raw in messages:
        name, frame = raw.topic.name, None
        if name in counts:
            frame = counts[name]
            counts[name] += 1
        if name in latched and raw.log_time_ns < start_ns:
            early.append(replace(raw, log_time_ns=start_ns))
        elif name in latched or (clouds_only and frame is None) or plan.keeps(name, frame, raw.log_time_ns):
            yield from ((None, message) for message in early)
            early.clear()
            yield frame, raw


def _is_latched(profiles: tuple[object, ...]) -> bool:
    return any(getattr(qos, "durability", None) is QosDurability.TRANSIENT_LOCAL for qos in profiles)

"""The messages of an adversarial bag: of the changed drive, those of the chosen frames."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.mcap.qos import is_latched
from advpipe.stages.attack.clouds import CloudPlan


def messages_of_frames(
    reader: BagReader, plan: CloudPlan, changed: Iterable[RawMessage] | None = None
) -> Iterator[tuple[int | None, RawMessage]]:
    """Each message of the plan's frames, with its index in the clean bag if it is a cloud of its topics.

    changed: all messages of the drive in log-time order, where attacks changed some: of these, only clouds of
    the plan's topics are left out. Without them, the bag is read, and no more of it than is needed. Latched
    topics (/tf_static, /scenario/info) other than the plan's are kept whole: those from before the first
    chosen frame are logged at its time, so that the bag does not begin with a long silence.
    """
    is_cut = changed is None and plan.frames[0] > 0
    start_ns = int(plan.times_ns[plan.frames[0]]) if is_cut else 0
    latched = {name for name, info in reader.topics.items() if is_latched(info.qos)} - {*plan.topics}
    messages = _near(reader, plan, start_ns, latched) if changed is None else changed
    counts = {name: int(np.searchsorted(reader.log_times_ns(name), start_ns)) for name in plan.topics}
    early: list[RawMessage] = []
    for raw in messages:
        name, frame = raw.topic.name, None
        if name in counts:
            frame = counts[name]
            counts[name] += 1
        if name in latched and raw.log_time_ns < start_ns:
            early.append(replace(raw, log_time_ns=start_ns))
        elif (
            name in latched
            or (changed is not None and frame is None)
            or plan.keeps(name, frame, raw.log_time_ns)
        ):
            yield from ((None, message) for message in early)
            early.clear()
            yield frame, raw


def _near(
    reader: BagReader, plan: CloudPlan, start_ns: int, latched: Collection[str]
) -> Iterator[RawMessage]:
    """The messages of latched topics, and all from a time on to the cloud after the last chosen frame."""
    next_frame = plan.frames[-1] + 1
    end_ns = int(plan.times_ns[next_frame]) if next_frame < len(plan.times_ns) else None
    if start_ns:
        yield from reader.raw_messages(latched, last_ns=start_ns - 1)
    yield from reader.raw_messages(first_ns=start_ns, last_ns=end_ns)
    if end_ns is not None:
        yield from reader.raw_messages(latched, first_ns=end_ns + 1)

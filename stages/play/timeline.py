"""The messages of a bag that are played, in the order in which they are due."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.live.offered_qos import offered_qos
from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import CLOCK
from advpipe.pipeline.messages.types import schema_text, serialise
from advpipe.stages.play.options import PlayOptions

CLOCK_HZ = 40.0
"""How often /clock is published where the bag has none; the rate of `ros2 bag play --clock`."""


_END_OF_TIME_NS = 2**31 * 10**9


class Timeline:
    """The chosen messages of a bag, from its start or a later moment on.

    published: the chosen topics, /clock among them. begin_ns: the first recorded time that is played.
    Raises UsageError where nothing is left to play.
    """

    def __init__(self, reader: BagReader, options: PlayOptions) -> None:
        self._reader = reader
        recorded = [name for name, info in reader.topics.items() if info.count]
        if not recorded:
            raise UsageError(f"{reader.path} holds no messages")
        has_clock = CLOCK.name in recorded
        if options.clock_hz is not None:
            self._clock_hz = options.clock_hz
        else:
            self._clock_hz = 0.0 if has_clock else CLOCK_HZ
        keeps_clock = has_clock and options.clock_hz is None
        chosen = sorted(name for name in recorded if name != CLOCK.name and options.chooses(name))
        if not chosen and not (keeps_clock and options.chooses(CLOCK.name)):
            raise UsageError(
                f"{reader.path} has no topic {' or '.join(options.topics)}; "
                f"{known_names(options.topics[0] if options.topics else '', sorted(recorded), 'it has')}"
            )
        names = [*chosen, *([CLOCK.name] if keeps_clock else [])]
        self.published = [self._definition(name) for name in names]
        if self._clock_hz:
            self.published.append(PublishedTopic(CLOCK, schema_text(CLOCK.type)))
        first_ns = next(reader.raw_messages(recorded)).log_time_ns
        self.begin_ns = first_ns + round(options.start_s * 1e9)
        self._names = set(names)
        self._check_start(recorded, first_ns)

    def leave_out(self, topic_name: str) -> None:
        """Play without a topic, such as one that no publisher can announce."""
        self.published = [one for one in self.published if one.topic.name != topic_name]
        self._names.discard(topic_name)
        if topic_name == CLOCK.name:
            self._clock_hz = 0.0

    def latched_before(self) -> Iterator[RawMessage]:
        """What subscribers of latched topics have at the beginning if they followed from the start."""
        depths = {
            one.topic.name: offered_qos(one.topic).depth
            for one in self.published
            if one.topic.name in self._names and offered_qos(one.topic).is_latched
        }
        kept = {name: deque[RawMessage](maxlen=depth) for name, depth in depths.items()}
        for raw in self._reader.raw_messages(list(kept), last_ns=self.begin_ns - 1):
            kept[raw.topic.name].append(raw)
        yield from sorted((raw for each in kept.values() for raw in each), key=lambda raw: raw.log_time_ns)

    def messages(self) -> Iterator[RawMessage]:
        """From the beginning on; with /clock in between where it is not the recorded one."""
        tick = 0
        for raw in self._reader.raw_messages(self._names, first_ns=self.begin_ns):
            while self._clock_hz and (due_ns := self._tick_ns(tick)) <= raw.log_time_ns:
                yield clock_message(due_ns)
                tick += 1
            yield raw

    def _tick_ns(self, tick: int) -> int:
        return self.begin_ns + round(tick * 1e9 / self._clock_hz)

    def _definition(self, name: str) -> PublishedTopic:
        first = next(self._reader.raw_messages([name]))
        return PublishedTopic(first.topic, first.schema, first.schema_encoding)

    def _check_start(self, recorded: Collection[str], first_ns: int) -> None:
        if next(self._reader.raw_messages(self._names, first_ns=self.begin_ns), None) is not None:
            return
        last_ns = max(int(self._reader.log_times_ns(name)[-1]) for name in recorded)
        raise UsageError(
            f"{self._reader.path}: nothing is left to play; it has {(last_ns - first_ns) * 1e-9:.1f} s, "
            f"choose a smaller {option_name('start_s')}"
        )


def clock_message(time_ns: int) -> RawMessage:
    """A message of /clock. Raises AdvpipeError for a time beyond ROS 2's."""
    if time_ns >= _END_OF_TIME_NS:
        raise AdvpipeError(
            f"/clock cannot show {time_ns} ns, since ROS 2's time ends in 2038; leave it out with "
            f"{option_name('clock_hz', 0)}"
        )
    cdr = serialise(build.clock(time_ns), CLOCK.type)
    return RawMessage(CLOCK, schema_text(CLOCK.type), cdr, time_ns, time_ns, 0)

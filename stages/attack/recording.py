"""The times at which a bag begins and ends; schedules count from its beginning."""

from __future__ import annotations

from dataclasses import dataclass

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.scenario.attacks import NS_PER_S, AttackSpec


@dataclass(frozen=True)
class RecordedTimes:
    """The log times of the first and of the last message of a bag."""

    start_ns: int
    end_ns: int

    def time_s(self, log_time_ns: int) -> float:
        """Seconds since the first message: the time of `Schedule.active`."""
        return (log_time_ns - self.start_ns) / NS_PER_S

    def refuse_outside(self, spec: AttackSpec) -> None:
        """Raises AdvpipeError for an attack that begins after the end of the recording."""
        end_s = self.time_s(self.end_ns)
        if spec.schedule.from_s > end_s:
            raise UsageError(
                f"{spec.type}: its schedule begins at {spec.schedule.from_s:g} s, but the recording ends at "
                f"{end_s:g} s"
            )


def recording_of(reader: BagReader) -> RecordedTimes:
    """Read from the bag's index; raises AdvpipeError for a bag without messages."""
    spans_ns = [
        (int(times_ns[0]), int(times_ns[-1]))
        for times_ns in map(reader.log_times_ns, reader.topics)
        if len(times_ns)
    ]
    if not spans_ns:
        raise UsageError(f"{reader.path} holds no messages")
    starts_ns, ends_ns = zip(*spans_ns, strict=True)
    return RecordedTimes(min(starts_ns), max(ends_ns))

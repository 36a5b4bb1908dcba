"""What is played, how fast, and to whom."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fnmatch import fnmatchcase

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.options import option
from advpipe.pipeline.live import FOXGLOVE_PORT, MOST_DOMAIN_ID

FASTEST, MOST_CLOCK_HZ, LONGEST_DELAY_S = 100.0, 1000.0, 3600.0


@dataclass(frozen=True, kw_only=True)
class PlayOptions:
    """Raises UsageError for values out of bounds, and where neither ROS 2 nor Foxglove is asked for."""

    ros2: bool = option(False, "Publish to ROS 2 nodes by DDS; needs the extra [ros2], not ROS 2.")
    foxglove: bool = option(False, "Serve Foxglove and Lichtblick; needs the extra [foxglove].")
    rate: float = option(1.0, "Recorded seconds in a second.")
    loop: bool = option(False, "Begin again at the end, until ctrl-C.")
    start_s: float = option(0.0, "Seconds of the recording to skip; latched topics come all the same.")
    topics: tuple[str, ...] = option(
        (),
        "Only topics of this name or pattern, such as '/ego/*'; may be repeated. /clock comes along.",
    )
    clock_hz: float | None = option(
        None, "Publish /clock so often a recorded second instead of the recorded one; 0 for none."
    )
    delay_s: float = option(1.0, "Seconds before the first message, in which subscribers find the topics.")
    domain: int | None = option(None, "DDS domain of the ROS 2 nodes.")
    interface: str | None = option(None, "Network interface for ROS 2, such as lo for this machine alone.")
    port: int = option(FOXGLOVE_PORT, "Port for Foxglove on this machine; 0 for any free one.")

    def __post_init__(self) -> None:
        if not (self.ros2 or self.foxglove):
            ros2, foxglove = option_name("ros2", True), option_name("foxglove", True)
            raise UsageError(f"nobody would see the bag; give {ros2}, {foxglove} or both")
        _check("rate", self.rate, 1e-3, FASTEST)
        _check("start_s", self.start_s, 0.0, math.inf)
        _check("delay_s", self.delay_s, 0.0, LONGEST_DELAY_S)
        _check("clock_hz", self.clock_hz or 0.0, 0.0, MOST_CLOCK_HZ)
        _check("port", self.port, 0, 65535)
        _check("domain", self.domain or 0, 0, MOST_DOMAIN_ID)

    def chooses(self, topic_name: str) -> bool:
        """Whether a topic is among those to play; /clock is decided apart."""
        return not self.topics or any(fnmatchcase(topic_name, pattern) for pattern in self.topics)


def _check(name: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most or math.isinf(value):
        until = "" if math.isinf(most) else f" to {most:g}"
        raise UsageError(f"{option_name(name)} is {value:g}, but must be from {least:g}{until or ' on'}")

"""Between whom a relay stands, and where it records."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.options import option
from advpipe.pipeline.live import MOST_DOMAIN_ID

_PREFIX = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
LONGEST_S = 1e6


@dataclass(frozen=True, kw_only=True)
class RelayOptions:
    """Raises UsageError for values out of bounds, and where the graph or its domain is not named."""

    attack: Path = option(Path(), "YAML file with the topics and attacks; `advpipe schema --of relay`.")
    ros2: bool = option(False, "Relay in a ROS 2 graph by DDS; needs the extra [ros2], not ROS 2.")
    domain: int | None = option(None, "DDS domain of the graph; it has to be named.")
    prefix: str = option("attacked", "Before the names of the topics that the relay publishes.")
    interface: str | None = option(None, "Network interface, such as lo for this machine alone.")
    duration_s: float | None = option(None, "End after so many seconds.")
    clean: Path | None = option(
        None, "Bag that is played into the graph: its other topics complete the recording, for `evaluate`."
    )
    debug: bool = option(True, "Record debug topics, which show in viewers what was attacked.")

    def __post_init__(self) -> None:
        if not self.ros2:
            raise UsageError(f"name the graph to relay in; give {option_name('ros2', True)}")
        if self.domain is None:
            raise UsageError(
                f"name the DDS domain with {option_name('domain')}: what a relay publishes may deceive "
                "running vehicles"
            )
        if not 0 <= self.domain <= MOST_DOMAIN_ID:
            raise UsageError(
                f"{option_name('domain')} is {self.domain}, but must be from 0 to {MOST_DOMAIN_ID}"
            )
        if not _PREFIX.fullmatch(self.prefix):
            raise UsageError(
                f"{option_name('prefix')} {self.prefix[:40]!r} is no ROS 2 name; take letters, digits, "
                "underscores and slashes"
            )
        if self.duration_s is not None and not 0 < self.duration_s <= LONGEST_S:
            raise UsageError(
                f"{option_name('duration_s')} is {self.duration_s:g}, but must be above 0 and up to "
                f"{LONGEST_S:g}"
            )

    def published_name(self, topic_name: str) -> str:
        """The name of a relayed topic."""
        return f"/{self.prefix.strip('/')}{topic_name}"

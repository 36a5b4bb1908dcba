"""Playing a bag into running programs as a function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike
from advpipe.pipeline.core.progress import working_on
from advpipe.stages.play.options import PlayOptions

if TYPE_CHECKING:
    from advpipe.stages.play.summary import PlaySummary


def play(
    bag: PathLike,
    *,
    ros2: bool = False,
    foxglove: bool = False,
    rate: float = PlayOptions.rate,
    loop: bool = False,
    start_s: float = PlayOptions.start_s,
    topics: Sequence[str] = (),
    clock_hz: float | None = None,
    delay_s: float = PlayOptions.delay_s,
    domain: int | None = None,
    interface: str | None = None,
    port: int = PlayOptions.port,
    ready: Callable[[str], None] = lambda where: None,
) -> PlaySummary:
    """Play a bag into a ROS 2 graph, to Foxglove, or both, at the recorded rate.

    rate: recorded seconds in a second. loop: begins again until ctrl-C. start_s: seconds of the recording to
    skip; latched topics come all the same. topics: names or patterns such as `/ego/*`; all by default.
    clock_hz: publishes /clock so often instead of the recorded one, 0 for none. delay_s: before the first
    message. domain: of DDS, ROS_DOMAIN_ID by default. interface: of the network, for ROS 2. port: for
    Foxglove. ready: is called before the first message, with a text that says where the bag is played.

    Returns what was sent, and how late. Raises AdvpipeError, one line, for what cannot be played, a port that
    is taken and an interface that is not there. Needs the extra `ros2` or `foxglove`.

    >>> advpipe.play("datasets/smoke", ros2=True, domain=7, interface="lo").missed
    0
    """
    options = PlayOptions(
        ros2=ros2,
        foxglove=foxglove,
        rate=rate,
        loop=loop,
        start_s=start_s,
        topics=(topics,) if isinstance(topics, str) else tuple(topics),
        clock_hz=clock_hz,
        delay_s=delay_s,
        domain=domain,
        interface=interface,
        port=port,
    )
    with working_on("loading libraries"):
        from advpipe.stages.play.run import play as run

    return run(Path(bag), options, ready=ready)

"""Relaying and attacking the messages of a running graph as a function."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike
from advpipe.pipeline.campaigns.relay.options import RelayOptions
from advpipe.pipeline.core.progress import working_on

if TYPE_CHECKING:
    from advpipe.pipeline.campaigns.relay.summary import RelaySummary


def relay(
    attack: PathLike,
    *,
    domain: int | None,
    ros2: bool = True,
    prefix: str = RelayOptions.prefix,
    interface: str | None = None,
    out: PathLike | None = None,
    duration_s: float | None = None,
    clean: PathLike | None = None,
    debug: bool = RelayOptions.debug,
    overwrite: bool = False,
    ready: Callable[[str], None] = lambda where: None,
) -> RelaySummary:
    """Stand between the publishers and the consumers of a running ROS 2 graph, and attack what passes.

    attack: a YAML file with topics and attacks. domain: of DDS. prefix: before the names of the topics that
    are published. interface: of the network. out: the bag that records what was sent, with labels,
    `datasets/relay/<name of the file>` by default. duration_s: ends after so long; otherwise a signal does.
    clean: the bag that is played into the graph; its other topics complete the recording, so that `evaluate`
    compares both. debug: whether the bag has debug topics. ready: is called before the first message, with a
    text that says where the relay stands.

    Returns what became of the messages, and how late they were. Raises AdvpipeError, one line, for a bad
    file, a topic of another type and an interface that is not there. Needs the extra `ros2`.

    >>> advpipe.relay("relay.yaml", domain=7, interface="lo", duration_s=60).topics
    """
    options = RelayOptions(
        attack=Path(attack),
        ros2=ros2,
        domain=domain,
        prefix=prefix,
        interface=interface,
        duration_s=duration_s,
        clean=None if clean is None else Path(clean),
        debug=debug,
    )
    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.relay.run import relay as run
        from advpipe.pipeline.process.folder import working_path

    bag = working_path("datasets") / "relay" / Path(attack).stem if out is None else Path(out)
    return run(bag, options, overwrite=overwrite, ready=ready)

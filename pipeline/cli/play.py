"""The command that plays a bag into running programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, cli_option, print_line
from advpipe.pipeline.core.progress import end_progress, with_progress
from advpipe.stages.play.options import PlayOptions


@with_progress("playing {bag}")
def play_command(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap file.")],
    ros2: Annotated[bool, cli_option(PlayOptions, "ros2", "--ros2")] = False,
    foxglove: Annotated[bool, cli_option(PlayOptions, "foxglove", "--foxglove")] = False,
    rate: Annotated[float, cli_option(PlayOptions, "rate")] = PlayOptions.rate,
    loop: Annotated[bool, cli_option(PlayOptions, "loop", "--loop")] = False,
    start_s: Annotated[float, cli_option(PlayOptions, "start_s", "--start")] = PlayOptions.start_s,
    topics: Annotated[list[str] | None, cli_option(PlayOptions, "topics")] = None,
    clock_hz: Annotated[
        float | None, cli_option(PlayOptions, "clock_hz", "--clock", show_default="as recorded, or 40")
    ] = None,
    delay_s: Annotated[float, cli_option(PlayOptions, "delay_s", "--delay")] = PlayOptions.delay_s,
    domain: Annotated[
        int | None, cli_option(PlayOptions, "domain", show_default="ROS_DOMAIN_ID, or 0")
    ] = None,
    interface: Annotated[
        str | None, cli_option(PlayOptions, "interface", show_default="as ROS 2 would")
    ] = None,
    port: Annotated[int, cli_option(PlayOptions, "port")] = PlayOptions.port,
) -> Answer:
    """Play a bag into a ROS 2 graph or Foxglove at the recorded rate; space pauses, q or ctrl-C ends it."""
    from advpipe.commands.play import play
    from advpipe.pipeline.core.verbosity import notice

    def ready(where: str) -> None:
        end_progress()
        notice(f"{bag} is played to {where}; space pauses, q or ctrl-C ends it")

    summary = play(
        bag,
        ros2=ros2,
        foxglove=foxglove,
        rate=rate,
        loop=loop,
        start_s=start_s,
        topics=topics or (),
        clock_hz=clock_hz,
        delay_s=delay_s,
        domain=domain,
        interface=interface,
        port=port,
        ready=ready,
    )
    figures = (
        "loops",
        "messages",
        "missed",
        "missed_uncounted",
        "recorded_s",
        "late_median_ms",
        "late_p99_ms",
        "late_max_ms",
    )
    document = {"bag": summary.bag, **{name: getattr(summary, name) for name in figures}}
    return Answer({**document, "topics": summary.to_dicts()}, print_line(summary))

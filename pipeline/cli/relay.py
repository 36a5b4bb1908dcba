"""The command that attacks the messages of a running graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.campaigns.relay.options import RelayOptions
from advpipe.pipeline.cli.shared import Answer, Overwrite, cli_option, print_line
from advpipe.pipeline.core.progress import end_progress, with_progress


@with_progress("relaying by {attack}")
def relay_command(
    attack: Annotated[Path, cli_option(RelayOptions, "attack", "--attack")],
    ros2: Annotated[bool, cli_option(RelayOptions, "ros2", "--ros2")] = False,
    domain: Annotated[int | None, cli_option(RelayOptions, "domain", show_default="none")] = None,
    prefix: Annotated[str, cli_option(RelayOptions, "prefix")] = RelayOptions.prefix,
    interface: Annotated[
        str | None, cli_option(RelayOptions, "interface", show_default="as ROS 2 would")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Bag to make.", show_default="datasets/relay/<name of FILE>"),
    ] = None,
    duration_s: Annotated[float | None, cli_option(RelayOptions, "duration_s", "--duration")] = None,
    clean: Annotated[Path | None, cli_option(RelayOptions, "clean", show_default="none")] = None,
    debug: Annotated[bool, cli_option(RelayOptions, "debug", "--debug/--no-debug")] = RelayOptions.debug,
    overwrite: Overwrite = False,
) -> Answer:
    """Attack what passes between publishers and consumers of a ROS 2 graph, and record it; ctrl-C ends it."""
    from advpipe.commands.relay import relay
    from advpipe.pipeline.core.verbosity import notice

    def ready(where: str) -> None:
        end_progress()
        notice(f"the relay stands in {where}; ctrl-C ends it")

    summary = relay(
        attack,
        domain=domain,
        ros2=ros2,
        prefix=prefix,
        interface=interface,
        out=out,
        duration_s=duration_s,
        clean=clean,
        debug=debug,
        overwrite=overwrite,
        ready=ready,
    )
    figures = ("recorded", "unrecorded", "seconds", "cpu_s", "reason")
    document = {"bag": summary.bag, **{name: getattr(summary, name) for name in figures}}
    return Answer({**document, "topics": summary.to_dicts()}, print_line(summary), made={"bag": summary.bag})

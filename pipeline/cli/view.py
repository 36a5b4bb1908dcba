"""The command that shows a bag in 3D."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, LidarTopic, print_line
from advpipe.pipeline.core.progress import end_progress, with_progress


@with_progress("viewing {bag}")
def view_command(
    bag: Annotated[Path, typer.Argument(help="Data set (with all its attacks), rosbag2 folder or .mcap.")],
    lidar: LidarTopic = None,
    report: Annotated[
        Path | None,
        typer.Option(help="Report whose detections are shown.", show_default="the data set's first by name"),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Of this machine.", show_default="any free one")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
) -> Answer:
    """Turn a bag in 3D in the browser: LiDAR, truth, V2X and paths, clean and attacked; ctrl-C ends it."""
    from advpipe.pipeline.core.verbosity import notice
    from advpipe.stages.view.run import view

    addresses: list[str] = []

    def ready(url: str) -> None:
        addresses.append(url)
        end_progress()
        notice(f"{bag} is shown at {url} on this machine; ctrl-C ends it")

    view(bag, lidar_topic=lidar, report=report, port=port, open_browser=browser, ready=ready)
    return Answer({"url": addresses[0]}, print_line("ended"))

"""The commands about one bag: `inspect`, `plot` and `recover_command`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.completion import picture_formats
from advpipe.pipeline.cli.shared import Answer, LidarTopic, Overwrite, print_line, typed
from advpipe.pipeline.core.progress import with_progress


@with_progress("reading {bag}", at_once=False)
def inspect(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap.")],
) -> Answer:
    """What is in a bag: topics, rates, clouds, road users, V2X, provenance, checksums."""
    from advpipe.pipeline.bag.inspect import describe
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.core.errors import as_usage_error

    with as_usage_error():
        resolve_bag(bag)
    description = describe(bag)
    return Answer(vars(description), description.print, next_commands=[typed("view", bag)])


@with_progress("drawing {bag}")
def plot(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap.")],
    cloud: Annotated[
        int | None,
        typer.Option("--cloud", metavar="FRAME", min=0, help="Draw this LiDAR frame, from 0, from above."),
    ] = None,
    attacked: Annotated[
        Path | None,
        typer.Option(
            help="With --cloud: an adversarial version of the bag, to show the points that it changed.",
            show_default="none; an adversarial BAG is compared with the clean one beside it",
        ),
    ] = None,
    lidar: LidarTopic = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Picture to write: .png, .pdf or .svg.",
            show_default="v2x.png, or cloud-FRAME.png",
        ),
    ] = None,
    format: Annotated[
        str | None,
        typer.Option(
            help="png, pdf or svg.",
            show_default="by the extension of --out",
            autocompletion=picture_formats,
        ),
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Draw a drive's V2X (CAM rates, packets delivered by distance, channel load), or one LiDAR frame.

    A frame is drawn from above, with the true boxes if they are recorded and the points that an attack
    removed, added or moved.
    """
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.core.errors import UsageError, as_usage_error
    from advpipe.pipeline.core.picture_file import picture_path
    from advpipe.pipeline.process.folder import working_path

    picture = working_path(picture_path(out, format, "v2x" if cloud is None else f"cloud-{cloud}"))
    with as_usage_error():
        for path in filter(None, (bag, attacked)):
            resolve_bag(path)
    if cloud is None:
        if attacked is not None or lidar is not None:
            raise UsageError("--attacked and --lidar are about LiDAR frames; choose one with --cloud FRAME")
        from advpipe.pipeline.bag.v2x_picture import draw_bag

        draw_bag(bag, picture, overwrite)
    else:
        from advpipe.pipeline.bag.cloud_picture import draw_cloud

        draw_cloud(bag, cloud, picture, attacked=attacked, lidar_topic=lidar, overwrite=overwrite)
    return Answer(
        {"picture": picture}, lambda: None, made={"picture": picture}, next_commands=[typed("view", bag)]
    )


@with_progress("recovering {path}")
def recover_command(
    path: Annotated[
        Path, typer.Argument(help="What a killed run was to make, or a damaged data set, bag or .mcap.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Where to.", show_default="PATH-recovered")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Recover an incomplete recording as a complete bag or data set next to it.

    What a killed run wrote stays in a hidden folder until a later run for the same output has finished.
    """
    from advpipe.pipeline.bag.recover import recover as run

    recovery = run(path, out, overwrite=overwrite)
    counts = {key: value for key, value in vars(recovery).items() if isinstance(value, int)}
    found = {"bag": recovery.source.bag, "found": recovery.source.found}
    return Answer(
        {"recovered": recovery.out, **found, **counts},
        print_line(str(recovery).removeprefix(f"{recovery.out}: ")),
        made={"recovered": recovery.out} if recovery.out else {},
        next_commands=[typed("inspect", recovery.out)] if recovery.out else (),
    )

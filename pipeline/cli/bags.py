"""The commands about one bag: `inspect`, `plot` and `recover_command`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, print_line


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
    return Answer(vars(description), description.print)


def plot(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Picture to write: .png, .pdf or .svg.")] = Path(
        "v2x.png"
    ),
    overwrite: Overwrite = False,
) -> Answer:
    """Draw a drive's V2X: CAM rates, packets delivered by distance, channel load."""
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.bag.v2x_picture import draw_bag
    from advpipe.pipeline.core.errors import as_usage_error

    with as_usage_error():
        resolve_bag(bag)
    draw_bag(bag, out, overwrite)
    return Answer({"picture": out}, print_line(out))


def recover_command(
    path: Annotated[
        Path, typer.Argument(help="What a killed run was to make, or a damaged data set, bag or .mcap.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Where to.", show_default="PATH-recovered")
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Save what was written of a recording that was cut off, as a whole bag or data set beside it.

    What a killed run wrote stays in a hidden folder until a later run for the same output has finished.
    """
    from advpipe.pipeline.bag.recover import recover as run

    recovery = run(path, out, overwrite=overwrite)
    counts = {key: value for key, value in vars(recovery).items() if isinstance(value, int)}
    found = {"bag": recovery.source.bag, "found": recovery.source.found}
    return Answer({"recovered": recovery.out, **found, **counts}, print_line(recovery))

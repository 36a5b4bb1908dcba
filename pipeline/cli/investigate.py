"""The command that finds out who lied."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import Answer, Overwrite, typed
from advpipe.pipeline.core.progress import with_progress


@with_progress("investigating {bag}")
def investigate_command(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap.")],
    vehicle: Annotated[
        str | None,
        typer.Option("--vehicle", help="Whose sensors and messages.", show_default="ego, or the only one"),
    ] = None,
    pseudonyms: Annotated[
        float | None,
        typer.Option(
            "--pseudonyms",
            metavar="SECONDS",
            help="Stations change their ids here, after silences of up to so long (0: none); follow them.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Also write a page (.html).", show_default=False)
    ] = None,
    overwrite: Overwrite = False,
) -> Answer:
    """Find out which sensor or station lied, when and about what; exit code 1 if any did.

    It reads only what the vehicle had on board: its sensors, the messages that it received, its map and its
    own pose. What a bag holds of the truth and of attacks is not read.
    """
    from advpipe.commands.investigate import investigate

    found = investigate(bag, vehicle=vehicle, silence_s=pseudonyms, page=out, overwrite=overwrite)

    def show() -> None:
        for one in found.suspects:
            print(one)
        if found.explained:
            print(f"explained by the false GNSS: {', '.join(found.explained)}")
        for name, why in found.not_judged.items():
            print(f"not judged, {name}: {why}")
        print(found)

    return Answer(
        found.to_plain(),
        show,
        exit_code=1 if found.suspects else 0,
        made={} if out is None else {"page": out},
        next_commands=[typed("view", bag)],
    )

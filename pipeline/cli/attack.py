"""The command of stage 2."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.shared import DetectorName, Overwrite


def attack(
    bag: Annotated[
        Path | None, typer.Argument(help="Data set, rosbag2 folder or .mcap.", show_default="newest data set")
    ] = None,
    kind: Annotated[str, typer.Option("--type", help="Which attack: detach.")] = "detach",
    ratio: Annotated[float, typer.Option(help="Share of the points to remove (detach).")] = 0.01,
    recipe: Annotated[
        str, typer.Option(help="best, paper (as published) or random (the baseline).")
    ] = "best",
    frames: Annotated[str, typer.Option(help="start:stop:step; the bag then holds only these.")] = "::",
    detector: DetectorName = "small",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the attack's own draws.")] = 0,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="one a core")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Adversarial bag.", show_default="beside the clean one")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Stage 2: write an adversarial version of a bag; everything not attacked is copied byte for byte."""
    from advpipe.pipeline.bag.frames import FrameSlice
    from advpipe.pipeline.bag.locate import newest_dataset, resolve_bag
    from advpipe.pipeline.errors import writing
    from advpipe.stages.attack.run import AttackRequest, attack_id
    from advpipe.stages.attack.run import attack as run

    clean = resolve_bag(bag or newest_dataset(Path("datasets")))
    request = AttackRequest(
        type=kind,
        recipe=recipe,
        parameters={"ratio": ratio},
        detector=detector,
        frames=FrameSlice.parse(frames),
        seed=seed,
    )
    target = out or clean.parent / attack_id(request)
    with writing(target):
        print(run(clean, target, request, overwrite=overwrite, workers=workers))

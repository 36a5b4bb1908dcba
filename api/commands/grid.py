"""Grids of experiments as a function."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.pipeline.process.folder import refuse_undecodable

if TYPE_CHECKING:
    from advpipe.pipeline.campaigns.grid.run import GridReport


@with_progress("running the grid {file}")
def grid(
    file: PathLike,
    *,
    device: str = "cpu",
    keep_bags: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    out: PathLike | None = None,
    overwrite: bool = False,
) -> GridReport:
    """Run a grid of experiments: scenario keys, seeds, attacks, detectors and defences, each cell once.

    file: the grid file. device: where detectors compute, `cpu`, `cuda` or `cuda:N`. keep_bags: keeps the
    adversarial bags, beside the drives. workers: processes, by default one a core; their number changes no
    byte. cluster: as `attack` has it. out: the folder, by default `grids/<name>`; finished cells in it are
    kept. overwrite: computes those that other code of advpipe made again.

    Returns the cells of the grid, also in `grid.parquet` and `report.html` of the folder. Raises UsageError
    for a mistake in the file, before the first drive is simulated, and for a folder that is no grid's.

    >>> advpipe.grid("fog.yaml").to_pandas()
    """
    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.grid.run import Grid
        from advpipe.pipeline.cluster.connect import use_cluster

    target = None if out is None else Path(out)
    refuse_undecodable(*([] if target is None else [target]))
    with use_cluster(cluster, device):
        asked = Grid.prepared(
            Path(file), target, device=device, workers=workers, keep_bags=keep_bags, overwrite=overwrite
        )
        return asked.run()

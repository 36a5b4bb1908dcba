"""The sweep over budgets as a function."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from advpipe.commands.paths import PathLike, bag_or_newest, default_output
from advpipe.pipeline.campaigns.sweep.options import SweepOptions
from advpipe.pipeline.core.errors import as_usage_error
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.pipeline.detector.registry import detector_slug
from advpipe.pipeline.process.folder import refuse_undecodable

if TYPE_CHECKING:
    from advpipe.pipeline.campaigns.sweep.run import Sweep, SweepReport


@with_progress("sweeping {bag}")
def sweep(
    bag: PathLike | None = None,
    *,
    table: str = SweepOptions.table,
    recipes: str | Sequence[str] = SweepOptions.recipes,
    cells: str | Sequence[str] = SweepOptions.cells,
    frames: str | None = SweepOptions.frames,
    detector: str = SweepOptions.detector,
    device: str = SweepOptions.device,
    seed: int = SweepOptions.seed,
    seeds: int = SweepOptions.seeds,
    baseline_tries: int | None = SweepOptions.baseline_tries,
    defences: Sequence[str] | None = None,
    detect_attacks: Sequence[str] | None = None,
    lidar: str | None = SweepOptions.lidar_topic,
    lidar_height_m: float | None = SweepOptions.lidar_height_m,
    level: bool = SweepOptions.level,
    scale_intensity: float = SweepOptions.scale_intensity,
    keep_bags: bool = SweepOptions.keep_bags,
    workers: int | None = SweepOptions.workers,
    cluster: str | None = None,
    out: PathLike | None = None,
    overwrite: bool = False,
) -> SweepReport:
    """Attack and evaluate at every budget of the paper's tables; goes on where it was stopped.

    bag: a clean bag or its data set, by default the newest under `datasets`. table: whose budgets. recipes:
    of the attacks, such as `("best", "paper")`. cells: some budgets only, such as `("perturb-10",
    "detach-1")`. frames: `start:stop:step`, by default at most 100, equally spaced over the bag. seeds: how
    many, from `seed` on. defences, detect_attacks: as for `evaluate`, but none by default, and defences on
    all frames. keep_bags: keeps the adversarial bags that are made. out: the folder, by default
    `reports/sweep-<detector>` of the data set; finished cells in it are kept. overwrite: removes those of
    other settings. The other options are those of `evaluate`.

    Returns what the folder holds now, with a row a finished cell. Raises UsageError for an unknown budget,
    recipe or detector, and for a folder that is no sweep's.

    >>> advpipe.sweep(drive, cells="detach-1", frames="::10").to_dicts()
    """
    asked = prepared(
        bag,
        out,
        table=table,
        recipes=recipes,
        cells=cells,
        frames=frames,
        detector=detector,
        device=device,
        seed=seed,
        seeds=seeds,
        baseline_tries=baseline_tries,
        defences=tuple(defences or SweepOptions.defences),
        detect_attacks=tuple(detect_attacks or SweepOptions.detect_attacks),
        lidar_topic=lidar,
        lidar_height_m=lidar_height_m,
        level=level,
        scale_intensity=scale_intensity,
        keep_bags=keep_bags,
        workers=workers,
    )
    from advpipe.pipeline.cluster.connect import use_cluster

    with use_cluster(cluster, device):
        return asked.run(overwrite)


def prepared(
    bag: PathLike | None,
    out: PathLike | None,
    *,
    recipes: str | Sequence[str],
    cells: str | Sequence[str],
    **options: Any,
) -> Sweep:
    """The sweep of a bag in its folder, by default one of the data set's reports; options: as `SweepOptions`
    has them."""
    with as_usage_error():
        clean = bag_or_newest(bag)
    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.sweep.run import Sweep
    asked = SweepOptions(recipes=_names(recipes) or SweepOptions.recipes, cells=_names(cells), **options)
    name = f"sweep-{detector_slug(asked.detector)}"
    target = default_output(clean, name, "reports") if out is None else Path(out)
    refuse_undecodable(clean, target)
    return Sweep.prepared(clean, target, asked)


def _names(lists: str | Sequence[str]) -> tuple[str, ...]:
    """The names in one or several lists such as `best,paper`, each once."""
    text = lists if isinstance(lists, str) else ",".join(lists)
    return tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))

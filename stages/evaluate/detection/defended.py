"""What a defence is worth: average precision on clean and attacked clouds under it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.stages.evaluate.detection.arm import Arm
from advpipe.stages.evaluate.detection.comparison import Comparison, under
from advpipe.stages.evaluate.detection.figures import Row, precisions, ratio, ratio_draws


def defended_rows(
    comparison: Comparison,
    row: Row,
    arms: Mapping[str, Arm],
    classes: Sequence[str],
    in_map: Sequence[str],
    bootstrap: BlockBootstrap,
) -> Iterator[Row]:
    """One row a defence: clean and attacked under it, their ratio, and what it costs on clean clouds.

    map_ratio_percent: attacked to clean, both under the defence. kept_percent: clean under the defence to
    clean without. map_adv_percent: attacked under the defence to clean without.
    """
    clean = arms["clean"]
    for defence in comparison.defences:
        before = Arm.of(comparison.frames, under("clean", defence), classes, in_map, bootstrap)
        about: Row = {
            **{key: row[key] for key in ("bag", "detector", "attack", "recipe", "parameter", "value")},
            "defence": defence,
            "frames": row["frames"],
            "map_clean": before.mean_ap(),
            "map_clean_ci95": percentile_interval(before.map_draws()),
            "kept_percent": 100 * ratio(before.mean_ap(), clean.mean_ap()),
            "kept_ci95": percentile_interval(ratio_draws(before, clean)),
            **precisions(before, "clean"),
        }
        if "adv" not in arms:
            yield about
            continue
        after = Arm.of(comparison.frames, under("adv", defence), classes, in_map, bootstrap)
        yield about | {
            "map_adv": after.mean_ap(),
            "map_adv_ci95": percentile_interval(after.map_draws()),
            "map_ratio_percent": 100 * ratio(after.mean_ap(), before.mean_ap()),
            "map_ratio_ci95": percentile_interval(ratio_draws(after, before)),
            "map_adv_percent": 100 * ratio(after.mean_ap(), clean.mean_ap()),
            "map_adv_percent_ci95": percentile_interval(ratio_draws(after, clean)),
            **precisions(after, "adv"),
        }

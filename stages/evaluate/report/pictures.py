"""The pictures of a report, as PNG files and for the page itself."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg

from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.core.progress import track
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.report.birds_eye import draw_scene
from advpipe.stages.evaluate.report.budget_curves import budget_groups, draw_budget_curves
from advpipe.stages.evaluate.report.clean import distinct_clean, of_first_detector
from advpipe.stages.evaluate.report.curves import ATTACK_LINES, CLEAN_LINES, draw_precision_curves
from advpipe.stages.evaluate.report.numbers import short_name
from advpipe.stages.evaluate.report.ratios import draw_ratios
from advpipe.stages.evaluate.report.scene import attack_name, best_frames, load_scene, worst_frames
from advpipe.stages.evaluate.report.section import ATTACK, CLEAN, OVERVIEW, ReportPicture
from advpipe.stages.evaluate.report.strata_plot import draw_strata

WORST, BEST = 3, 1
WORST_CLEAN, BEST_CLEAN = 2, 2


def draw_pictures(
    clean: Path, summaries: Sequence[Summary], lidar_topic: str | None = None
) -> list[ReportPicture]:
    """All pictures of the clouds of a report; frames and curves by class are those of its first detector."""
    pictures = []
    rows = [summary.result for summary in summaries if summary.comparison.bag]
    if rows:
        figure = draw_ratios(rows)
        pictures.append(
            ReportPicture(OVERVIEW, "", "map_ratio.png", "mAP ratio of each attack", to_png(figure))
        )
    for number, group in enumerate(budget_groups(rows)):
        seen_by = short_name(group[0].detector)
        attack = attack_name(group[0].attack)
        caption = f"mAP ratio over budget and Chamfer distance: {attack}, seen by {seen_by}"
        name = f"budget{number + 1}.png"
        pictures.append(ReportPicture(OVERVIEW, "", name, caption, to_png(draw_budget_curves(group))))
    first = of_first_detector(summaries)
    for number, summary in enumerate(distinct_clean(first)):
        pictures += _clean_pictures(summary, f"-{summary.comparison.name}" if number else "")
    for summary in track(first, "pictures", len(first)):
        pictures += _bag_pictures(clean, summary, lidar_topic)
    return pictures


def _clean_pictures(summary: Summary, suffix: str) -> Iterator[ReportPicture]:
    """Average precision on the clean clouds."""
    bag = summary.comparison.name
    yield ReportPicture(
        CLEAN,
        bag,
        f"precision_recall{suffix}.png",
        "Precision over recall on the clean clouds, with AP R40",
        to_png(draw_precision_curves(summary, CLEAN_LINES)),
    )
    yield ReportPicture(
        CLEAN,
        bag,
        f"strata{suffix}.png",
        "Average precision of parts of the objects, with its 95 % interval where there is one; the number is "
        "that of the boxes",
        to_png(draw_strata(summary.precisions["clean"])),
    )


def _bag_pictures(clean: Path, summary: Summary, lidar_topic: str | None) -> Iterator[ReportPicture]:
    """What an attack does to precision and recall, and the worst and best frames of a bag."""
    bag, attacked = summary.comparison.name, summary.comparison.bag is not None
    section = ATTACK if attacked else CLEAN
    if attacked:
        caption = (
            "Precision over recall, strict 3D: attacked, clean, and the weakest baseline, one draw at random "
            "anywhere; with AP R40"
        )
        figure = draw_precision_curves(summary, ATTACK_LINES)
        yield ReportPicture(section, bag, f"{bag}-precision_recall.png", caption, to_png(figure))
    worst = worst_frames(summary, WORST if attacked else WORST_CLEAN)
    best = best_frames(summary, BEST if attacked else BEST_CLEAN, worst)
    for which, frames in (("Worst", worst), ("Best", best)):
        for frame in frames:
            scene = load_scene(clean, summary, frame, lidar_topic)
            caption = f"{which} frames: {scene.title}"
            png = to_png(draw_scene(scene))
            yield ReportPicture(section, bag, f"{scene.name}.png", caption, png, is_wide=attacked)


def to_png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes for the same figure; no display is needed."""
    stream = io.BytesIO()
    with rc_context({"font.family": "DejaVu Sans"}):
        FigureCanvasAgg(figure)
        figure.savefig(stream, format="png", metadata={"Software": None})
    return stream.getvalue()

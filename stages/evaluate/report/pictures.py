"""The pictures of a report, as PNG and SVG."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import replace
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
from advpipe.stages.evaluate.report.headline_detection import strongest_attack
from advpipe.stages.evaluate.report.numbers import short_name
from advpipe.stages.evaluate.report.ratios import draw_ratios
from advpipe.stages.evaluate.report.scene import attack_name, best_frames, load_scene, worst_frames
from advpipe.stages.evaluate.report.section import ATTACK, CLEAN, FIRST_SCREEN, OVERVIEW, ReportPicture
from advpipe.stages.evaluate.report.strata_plot import draw_strata
from advpipe.stages.evaluate.report.wording import marks_mean
from advpipe.stages.evaluate.report.worst_picture import draw_worst

WORST, BEST = 3, 1
WORST_CLEAN, BEST_CLEAN = 2, 2

POINTS_DPI = 150
"""Of the points of clouds in vector pictures, where they are pixels."""


def draw_pictures(
    clean: Path, summaries: Sequence[Summary], lidar_topic: str | None = None
) -> list[ReportPicture]:
    """All pictures of the clouds of a report; frames and curves by class are those of its first detector."""
    pictures = []
    rows = [summary.result for summary in summaries if summary.comparison.bag]
    if rows:
        figure = draw_ratios(rows)
        pictures.append(
            picture_of(OVERVIEW, "", "map_ratio.png", "mAP ratio of each attack, in percent", figure)
        )
    for number, group in enumerate(budget_groups(rows)):
        seen_by = short_name(group[0].detector)
        attack = attack_name(group[0].attack)
        caption = f"mAP ratio over budget and Chamfer distance: {attack}, seen by {seen_by}"
        name = f"budget{number + 1}.png"
        pictures.append(picture_of(OVERVIEW, "", name, caption, draw_budget_curves(group)))
    first = of_first_detector(summaries)
    for number, summary in enumerate(distinct_clean(first)):
        pictures += _clean_pictures(summary, f"-{summary.comparison.name}" if number else "")
    shown = strongest_attack(rows).bag if rows else first[0].comparison.name if first else ""
    for summary in track(first, "pictures", len(first)):
        pictures += _bag_pictures(
            clean, summary, lidar_topic, on_first_screen=summary.comparison.name == shown
        )
    return pictures


def _clean_pictures(summary: Summary, suffix: str) -> Iterator[ReportPicture]:
    """Average precision on the clean clouds."""
    bag = summary.comparison.name
    yield picture_of(
        CLEAN,
        bag,
        f"precision_recall{suffix}.png",
        "Precision over recall on the clean clouds, with AP R40",
        draw_precision_curves(summary, CLEAN_LINES),
    )
    yield picture_of(
        CLEAN,
        bag,
        f"strata{suffix}.png",
        "Average precision of parts of the objects, with its 95 % interval where there is one; the number is "
        "that of the boxes",
        draw_strata(summary.precisions["clean"]),
    )


def _bag_pictures(
    clean: Path, summary: Summary, lidar_topic: str | None, *, on_first_screen: bool
) -> Iterator[ReportPicture]:
    """What an attack does to precision and recall, and the worst and best frames of a bag; the worst one in
    two more shapes for the first screen."""
    bag, attacked = summary.comparison.name, summary.comparison.bag is not None
    section = ATTACK if attacked else CLEAN
    if attacked:
        caption = (
            "Precision over recall, strict 3D: attacked, clean, and under random-best, which spends the same "
            "budget; with AP R40"
        )
        figure = draw_precision_curves(summary, ATTACK_LINES)
        yield picture_of(section, bag, f"{bag}-precision_recall.png", caption, figure)
    worst = worst_frames(summary, WORST if attacked else WORST_CLEAN)
    best = best_frames(summary, BEST if attacked else BEST_CLEAN, worst)
    for which, frames in (("Worst", worst), ("Best", best)):
        for rank, frame in enumerate(frames):
            scene = load_scene(clean, summary, frame, lidar_topic)
            caption = f"{which} frame: {scene.title}"
            yield picture_of(section, bag, f"{scene.name}.png", caption, draw_scene(scene), attacked)
            if on_first_screen and which == "Worst" and rank == 0:
                for shape in ("wide", "tall"):
                    name = f"{scene.name}-{shape}.png"
                    figure = draw_worst(scene, is_tall=shape == "tall")
                    about = f"{caption}. {marks_mean(scene.min_score, attacked)}"
                    drawn = picture_of(FIRST_SCREEN, bag, name, about, figure, shape == "wide")
                    yield replace(drawn, is_worst=True)


def picture_of(
    section: str, bag: str, file_name: str, caption: str, figure: Figure, is_wide: bool = True
) -> ReportPicture:
    """The figure as PNG and SVG; file_name: of the PNG."""
    figure.lay_out()
    return ReportPicture(section, bag, file_name, caption, to_png(figure), is_wide, svg=to_svg(figure))


def to_png(figure: Figure) -> bytes:
    """The figure as PNG, the same bytes for the same figure; no display is needed."""
    FigureCanvasAgg(figure)
    return _saved(figure, "png", {"Software": None})


def to_svg(figure: Figure) -> bytes:
    """The figure as SVG, the same bytes for the same figure; texts are outlines, which need no font."""
    return _saved(figure, "svg", {"Date": None}, dpi=POINTS_DPI)


def to_pdf(figure: Figure) -> bytes:
    """The figure as PDF, the same bytes for the same figure."""
    return _saved(figure, "pdf", {"CreationDate": None}, dpi=POINTS_DPI)


def _saved(figure: Figure, kind: str, metadata: dict[str, None], dpi: float | str = "figure") -> bytes:
    stream = io.BytesIO()
    with rc_context({"font.family": "DejaVu Sans", "svg.hashsalt": "advpipe"}):
        figure.savefig(stream, format=kind, metadata=metadata, dpi=dpi)
    return stream.getvalue()

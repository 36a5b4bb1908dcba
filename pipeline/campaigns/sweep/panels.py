"""The paper's figure of four panels: one frame clean, perturbed, with points attached, and detached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from advpipe.pipeline.bag.frames import FrameSlice
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.campaigns.sweep.cell import Cell
from advpipe.pipeline.core.figure import Figure
from advpipe.pipeline.detector.device import CPU
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.summary import summarise
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.report.birds_eye import draw_view, legend
from advpipe.stages.evaluate.report.scene import ReportScene, crop, load_scene
from advpipe.stages.evaluate.report.style import INK

RULE = (
    "of the frames in which the detector finds anything, the one with the median number of objects lost (at "
    "loose overlap) to the three attacks together (of two, the lower; of equal ones, the first)"
)
"""How the frame is chosen: neither the best nor the worst for the attacks."""

PANELS = ("perturb-10", "attach-0.5", "detach-1")
"""After the clean cloud, in the paper's order; the budgets of its Table I."""


def median_frame(cells: Sequence[Cell]) -> int | None:
    """The frame that `RULE` chooses, by its index in the clean bag; of cells with the same frames.

    None where nothing is found in any frame.
    """
    totals = [sum(lost) for lost in zip(*(cell.lost_objects for cell in cells), strict=True)]
    order = sorted(
        (total, frame)
        for total, frame, found in zip(totals, cells[0].frames, cells[0].found_objects, strict=True)
        if found
    )
    if not order:
        return None
    median = order[(len(order) - 1) // 2][0]
    return next(frame for total, frame in order if total == median)


def load_scenes(
    clean: Path, bags: Sequence[Path], detector: str, frame: int, cells: Sequence[Cell], device: str = CPU
) -> list[ReportScene]:
    """The frame before and after each attack; boxes are those above the working score of the cells."""
    settings = cells[0].settings
    run = DetectionRun(
        detector,
        clean,
        {bag: BagReader(bag).provenance for bag in bags},
        Options(
            detectors=(detector,),
            seed=settings.seed,
            baseline=False,
            defences=(),
            frames=FrameSlice(frame, frame + 1),
            lidar_topic=settings.lidar_topic,
            device=device,
            detect_attacks=("none",),
        ),
    )
    scenes = []
    for comparison, cell in zip(run.comparisons(1), cells, strict=True):
        score = cell.row.counts.working_score
        summary = replace(summarise(comparison, 1, settings.seed), min_score=score)
        scenes.append(load_scene(clean, summary, comparison.frames[0], settings.lidar_topic))
    return scenes


def draw_panels(scenes: Sequence[ReportScene], titles: Sequence[str], headline: str) -> Figure:
    """Four panels: clean, then each scene after its attack."""
    first = scenes[0]
    clean = replace(first, lost=np.zeros_like(first.lost), after=None, change=None)
    limits = crop([first.truth.boxes.geometry[first.truth.is_evaluated]], margin_m=8.0, least_m=50.0)
    figure = Figure(figsize=(15.0, 15.6), dpi=110, facecolor="white", layout="constrained")
    figure.suptitle(headline, x=0.01, ha="left", fontsize=14, fontweight="bold", color=INK)
    shown = [(clean, clean.before, "Clean"), *((s, s.after, t) for s, t in zip(scenes, titles, strict=True))]
    for place, (scene, view, title) in enumerate(shown):
        axes = figure.add_subplot(2, 2, place + 1)
        assert view is not None
        draw_view(axes, scene, view, limits, point_area=0.7)
        lost = "" if scene is clean else f", {int(scene.lost.sum())} objects lost (loose overlap)"
        label = f"({'abcd'[place]}) {title}: {len(view.cloud):,} points{lost}"
        axes.set_title(label, loc="left", fontsize=11, color=INK, pad=6)
    entries = {str(entry.get_label()): entry for scene, _, _ in shown for entry in legend(scene)}
    figure.legend(
        handles=list(entries.values()), loc="outside lower center", ncols=4, frameon=False, fontsize=10,
        labelcolor=INK,
    )  # fmt: skip
    return figure

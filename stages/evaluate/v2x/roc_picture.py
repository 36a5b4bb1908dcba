"""The ROC curves of misbehaviour detectors, a panel for each attack."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from advpipe.stages.evaluate.report.style import BASELINE, INK, LOST, PREDICTION, SOFT, TRUTH
from advpipe.stages.evaluate.v2x.detection import Detection, ScoredAttack

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from advpipe.pipeline.core.figure import Figure

_COLUMNS = 4
_COLOURS = (TRUTH, LOST, PREDICTION, BASELINE, INK)


def draw_roc(detections: Sequence[Detection]) -> Figure:
    """The curves of all detectors on each attack with false messages; a dot where the detector stands."""
    from advpipe.pipeline.core.figure import Figure

    parts = [part for each in detections for part in each.parts if part.false_messages]
    columns = min(_COLUMNS, len(parts))
    rows = -(-len(parts) // columns)
    size = (3.0 * columns + 0.4, 2.9 * rows + 0.6)
    figure = Figure(figsize=size, dpi=110, facecolor="white", layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for axes, part in zip(panels, parts, strict=False):
        _draw_attack(axes, part)
    for axes in panels[len(parts) :]:
        axes.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _draw_attack(axes: Axes, part: ScoredAttack) -> None:
    for number, (name, found) in enumerate(part.detectors.items()):
        colour = _COLOURS[number % len(_COLOURS)]
        curve, at = found.roc, found.scores
        axes.plot(curve.false_positive_rates, curve.recalls, color=colour, linewidth=1.4, label=name)
        axes.plot([at.false_positive_rate], [at.recall], marker="o", markersize=4, color=colour)
    axes.plot([0, 1], [0, 1], color=SOFT, linewidth=0.6, linestyle=":")
    axes.set_title(part.attack, loc="left", fontsize=9, color=INK)
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), aspect="equal")
    axes.set_xlabel("false-positive rate", fontsize=8, color=SOFT)
    axes.set_ylabel("recall", fontsize=8, color=SOFT)
    axes.tick_params(labelsize=8, colors=SOFT)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)

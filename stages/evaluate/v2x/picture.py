"""The Local Dynamic Map of a vehicle as a picture, before and during an attack; and detection per attack."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from advpipe.pipeline.misbehaviour.roads import RoadMap
from advpipe.stages.evaluate.report.style import BASELINE, INK, LOST, PREDICTION, SOFT, TRUTH, plain_axes
from advpipe.stages.evaluate.v2x.collision import known_of_radio
from advpipe.stages.evaluate.v2x.detection import Detection
from advpipe.stages.evaluate.v2x.ldm_error import DISPLACED_M, MISSING_WITHIN_M, Known, LdmError, Moment

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from advpipe.pipeline.core.figure import Figure

REACH_M = MISSING_WITHIN_M
ROAD = "#eef1f5"


def draw_maps(before: Moment, during: Moment, roads: RoadMap | None = None) -> Figure:
    """Two maps of the same vehicle beside each other, around itself, on the roads where they are known."""
    from advpipe.pipeline.core.figure import Figure

    figure = Figure(figsize=(12.0, 5.4), dpi=110, facecolor="white", layout="constrained")
    panels = figure.subplots(1, 2).tolist()
    for axes, moment, when in zip(panels, (before, during), ("before", "during the attack"), strict=True):
        draw_map(axes, moment, roads)
        time_s = (moment.time_ns - before.time_ns) / 1e9
        later = f", {time_s:.1f} s later" if time_s else ""
        axes.set_title(f"{when}{later}", loc="left", fontsize=11, color=INK)
    handles, labels = panels[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def draw_map(axes: Axes, moment: Moment, roads: RoadMap | None = None) -> None:
    """True stations in blue outlines; entries filled: true in grey, displaced in orange, false in red."""
    own = known_of_radio(moment.own)
    truth = {radio.station_id: known_of_radio(radio) for radio in moment.others}
    plain_axes(axes)
    if roads is not None:
        _draw_roads(axes, roads, own)
    entries: dict[str, list[Known]] = {"true": [], "displaced": [], "false": []}
    for entry in moment.entries:
        true = truth.get(entry.station_id)
        if entry.station_id not in moment.present or entry.station_id == own.station_id:
            entries["false"].append(entry)
        elif true is None or math.hypot(entry.x_m - true.x_m, entry.y_m - true.y_m) <= DISPLACED_M:
            entries["true"].append(entry)
        else:
            entries["displaced"].append(entry)
            axes.plot(
                [entry.x_m - own.x_m, true.x_m - own.x_m],
                [entry.y_m - own.y_m, true.y_m - own.y_m],
                color=LOST,
                linewidth=0.8,
                zorder=2,
            )
    for name, colour in (("true", BASELINE), ("displaced", LOST), ("false", PREDICTION)):
        label = f"{name} entry"
        _draw_boxes(axes, entries[name], own, label, facecolor=colour, edgecolor=colour, alpha=0.75)
    _draw_boxes(axes, list(truth.values()), own, "station", facecolor="none", edgecolor=TRUTH)
    _draw_boxes(axes, [own], own, "the vehicle itself", facecolor=INK, edgecolor=INK)
    axes.set(xlim=(-REACH_M, REACH_M), ylim=(-REACH_M, REACH_M), aspect="equal")
    axes.set_xlabel("east of the vehicle [m]", color=SOFT)
    axes.set_ylabel("north [m]", color=SOFT)


def draw_detection(detections: Sequence[Detection]) -> Figure:
    """F1 of each attack: ours, the baseline's, and what is published of CaTCH on other data."""
    from advpipe.pipeline.core.figure import Figure

    parts = [part for each in detections for part in each.parts]
    places = np.arange(len(parts))[::-1]
    height = 0.42 * len(parts) + 1.1
    figure = Figure(figsize=(11.0, height), dpi=110, facecolor="white", layout="constrained")
    axes = figure.add_subplot()
    plain_axes(axes)
    for offset, colour, label, values in (
        (0.18, TRUTH, "misbehaviour detector", [each.ours.f1 for each in parts]),
        (-0.18, BASELINE, "baseline (CaTCH's checks)", [each.baseline.f1 for each in parts]),
    ):
        axes.barh(places + offset, np.nan_to_num(values), 0.34, color=colour, label=label)
    published = [each.published for each in parts]
    if np.isfinite(published).any():
        axes.plot(published, places, "D", color=LOST, markersize=5, label="CaTCH, published, other data")
    axes.set_yticks(places, [each.attack for each in parts])
    axes.set(xlim=(0, 1.005))
    axes.set_xlabel("F1 of messages", color=SOFT)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def draw_errors(clean: LdmError, attacked: LdmError, title: str = "") -> Figure:
    """False, missing and displaced entries over time, clean and attacked."""
    from advpipe.pipeline.core.figure import Figure

    figure = Figure(figsize=(11.0, 3.0), dpi=110, facecolor="white", layout="constrained")
    start_ns = int(attacked.time_ns[0]) if len(attacked.time_ns) else 0
    for axes, name in zip(
        figure.subplots(1, 3).tolist(), ("false_entries", "missing", "displaced"), strict=True
    ):
        plain_axes(axes)
        for error, colour, label in ((clean, BASELINE, "clean"), (attacked, PREDICTION, "attacked")):
            axes.plot(
                (error.time_ns - start_ns) / 1e9,
                getattr(error, name),
                color=colour,
                label=label,
                linewidth=1.2,
            )
        axes.set_title(name.replace("_", " "), loc="left", fontsize=11, color=INK)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("time [s]", color=SOFT)
    figure.axes[0].legend(fontsize=8, frameon=False)
    if title:
        figure.suptitle(title, fontsize=11, color=INK)
    return figure


def _draw_roads(axes: Axes, roads: RoadMap, own: Known) -> None:
    """The centre lines of nearby lanes, about as wide as lanes."""
    from matplotlib.collections import LineCollection

    pieces_m = roads.segments_m - (own.x_m, own.y_m)
    begin_m, end_m = pieces_m.min(axis=1), pieces_m.max(axis=1)  # a straight road may end far on either side
    near = (begin_m < REACH_M).all(axis=1) & (end_m > -REACH_M).all(axis=1)
    axes.add_collection(LineCollection(list(pieces_m[near]), colors=ROAD, linewidths=3.5, zorder=1))


def _draw_boxes(axes: Axes, found: Sequence[Known], own: Known, label: str, **style: object) -> None:
    from matplotlib.collections import PolyCollection

    corners = [c for c in (_corners(each, own) for each in found) if c is not None]
    axes.add_collection(PolyCollection(corners, label=label, zorder=3, **style))  # type: ignore[arg-type]


def _corners(known: Known, own: Known) -> list[tuple[float, float]] | None:
    """Corners relative to the vehicle, of a small box where no size is stated; None without a position."""
    if not math.isfinite(known.x_m + known.y_m):
        return None
    yaw_rad = known.yaw_rad if math.isfinite(known.yaw_rad) else 0.0
    length_m, width_m = (value if math.isfinite(value) else 1.0 for value in (known.length_m, known.width_m))
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    halves = ((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))
    return [
        (
            known.x_m - own.x_m + cosine * a * length_m - sine * b * width_m,
            known.y_m - own.y_m + sine * a * length_m + cosine * b * width_m,
        )
        for a, b in halves
    ]

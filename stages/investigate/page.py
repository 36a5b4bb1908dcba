"""The page of an investigation: a time line of each suspect, the evidence in words, and pictures of it."""

from __future__ import annotations

import math
from importlib.resources import files
from typing import Any

from advpipe.pipeline.core.html_page import rendered
from advpipe.stages.investigate.cue import FreeSpacePicture
from advpipe.stages.investigate.investigation import Investigation, NamedSuspect
from advpipe.stages.investigate.registry import CUES

WIDTH, LABELS, ROW = 1000, 190, 22
MOST_ROWS = 60
"""Suspects on the time line; those beyond have their sections all the same."""
MARGIN_M = 4.0


def investigation_page(found: Investigation, name: str) -> str:
    """The whole page. name: of the bag; text from a bag is escaped."""
    return rendered(
        files("advpipe.stages.investigate").joinpath("page.html").read_text(encoding="utf-8"),
        found=found,
        name=name,
        line=_time_line(found),
        pictures=[None if one.picture is None else _view(one.picture) for one in found.suspects],
        judged=[(cue, CUES[cue].meaning) for cue in found.judged],
    )


def _time_line(found: Investigation) -> dict[str, Any]:
    whole_s = max(found.duration_s, 1e-3)
    scale = (WIDTH - LABELS - 20) / whole_s
    step_s = 10 ** math.floor(math.log10(whole_s))
    step_s = next(part for part in (step_s / 5, step_s / 2, step_s) if whole_s / part <= 12)
    ticks = [number * step_s for number in range(math.floor(whole_s / step_s) + 1)]
    rows = [_bars(one, scale, ROW * number + 4) for number, one in enumerate(found.suspects[:MOST_ROWS])]
    return {
        "width": WIDTH,
        "height": ROW * len(rows) + 26,
        "ticks": [{"x": round(LABELS + scale * tick_s, 1), "words": f"{tick_s:g} s"} for tick_s in ticks],
        "rows": rows,
    }


def _bars(one: NamedSuspect, scale: float, y: int) -> dict[str, Any]:
    return {
        "name": one.name,
        "y": y,
        "bars": [
            {
                "x": round(LABELS + scale * episode.start_s, 1),
                "width": max(round(scale * (episode.end_s - episode.start_s), 1), 2.0),
                "alarm": round(LABELS + scale * episode.alarm_s, 1),
                "opacity": round(0.35 + 0.65 * episode.probability, 2),
            }
            for episode in one.episodes
        ],
    }


def _view(picture: FreeSpacePicture) -> dict[str, Any]:
    """Places in metres, with the vehicle's front upwards, as SVG has its axes."""
    points, rays, corners, origin = (
        [(round(-y_m, 2), round(-x_m, 2)) for x_m, y_m in places.reshape(-1, 2).tolist()]
        for places in picture
    )
    shown = [*corners, *origin]
    low_x, low_y = (min(place[axis] for place in shown) - MARGIN_M for axis in (0, 1))
    high_x, high_y = (max(place[axis] for place in shown) + MARGIN_M for axis in (0, 1))
    return {
        "box": f"{low_x:g} {low_y:g} {high_x - low_x:g} {high_y - low_y:g}",
        "points": [(x, y) for x, y in points if low_x <= x <= high_x and low_y <= y <= high_y],
        "rays": rays,
        "corners": " ".join(f"{x},{y}" for x, y in corners),
        "origin": origin[0],
    }

"""A scene as the text that a page holds and the scripts in `page/` read: at most 2 MB."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from advpipe.pipeline.core.text import escape_unprintable
from advpipe.pipeline.viewer.points import ScenePoints, packed_metres
from advpipe.pipeline.viewer.scene import Fact, SceneBox, SceneLine, ViewerScene

FORMAT = "advpipe-scene-1"
LIMIT_BYTES = 2_000_000
MOST_BOXES, MOST_LINE_PLACES = 1000, 20_000
"""What is nearest to the sensor is shown; bags may hold any number."""

_LINES_REACH_M = 150.0


def encode_scene(scene: ViewerScene, limit_bytes: int = LIMIT_BYTES) -> str:
    """The scene as JSON in ASCII, at most so many bytes long, which may stand in a script element.

    Points are quantised to a 32767th of the farthest one; where they are too many, only every n-th is there,
    and the note says so.
    """
    known = [box for box in scene.boxes if np.isfinite(box.box).all()]
    boxes = sorted(known, key=_distance_m)[:MOST_BOXES]
    points = ScenePoints.of(scene.clean, scene.attacked, scene.difference)
    frame = {
        "format": FORMAT,
        "name": scene.name,
        "title": _plain(scene.title),
        "label": _plain(scene.label),
        "is_attacked": scene.attacked is not None,
        "ground_z_m": _ground_z_m(points),
        "boxes": [_packed_box(box) for box in boxes],
        "lines": _packed_lines(scene.lines),
    }
    spare_bytes = limit_bytes - len(_json(frame)) - 2000 - len(scene.note)
    shown = points.thinned(spare_bytes * 3 // 4)
    return _json({**frame, "note": _plain(_note(scene.note, shown)), "points": shown.packed()})


def _json(document: object) -> str:
    text = json.dumps(document, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")  # nothing in it ends a script


def _note(note: str, points: ScenePoints) -> str:
    shown, total = sum(points.counts), sum(points.total)
    thinned = f"Shown are {shown:,} of {total:,} points." if shown < total else ""
    return " ".join(filter(None, (note, thinned)))


def _packed_box(box: SceneBox) -> dict[str, object]:
    return {
        **{key: _plain(value) for key, value in asdict(box).items() if isinstance(value, str)},
        "box": [round(float(value), 3) for value in box.box],
        "facts": [_packed_fact(fact) for fact in box.facts],
    }


def _packed_fact(fact: Fact) -> list[str]:
    return [_plain(each) for each in (fact.name, fact.value, fact.attacked) if each is not None]


def _plain(text: str) -> str:
    """A text of a bag, which anybody may have written, as one that is short and printable."""
    return escape_unprintable(text)[:300]


def _packed_lines(lines: Sequence[SceneLine]) -> list[dict[str, object]]:
    packed, room = list[dict[str, object]](), MOST_LINE_PLACES
    for line in lines:
        for part in _near_parts(line.places):
            places = part[:room]
            room -= len(places)
            if len(places) > 1:
                text, unit_m = packed_metres(places)
                packed.append({"kind": line.kind, "condition": line.condition, "xyz": text, "unit_m": unit_m})
    return packed


def _near_parts(places: np.ndarray) -> list[np.ndarray]:
    """The parts of a line (K, 3) that are near the sensor."""
    near = (np.hypot(places[:, 0], places[:, 1]) <= _LINES_REACH_M) & np.isfinite(places).all(axis=1)
    ends = np.flatnonzero(np.diff(near)) + 1
    parts = np.split(places, ends)
    return [part for part, start in zip(parts, [0, *ends.tolist()], strict=True) if len(part) and near[start]]


def _distance_m(box: SceneBox) -> float:
    return math.hypot(box.box[0], box.box[1])


def _ground_z_m(points: ScenePoints) -> float:
    """The height of the ground below the sensor, as good as a cloud tells."""
    return float(np.quantile(points.places[:, 2], 0.05)) if len(points.places) else 0.0

"""Repairs the inner lanes of hairpin bends that netconvert truncates."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.stages.simulate.road_network.shape import length_m, parse_shape, shape_text

SHORT = 0.5
"""A lane shorter than this share of its neighbour has been truncated."""


def repair_lanes(net_file: Path) -> int:
    """Replace truncated lanes in the file by lanes beside their neighbours; return how many.

    netconvert cuts lanes where they meet the outline of a junction. Where a road bends so tightly that its
    inner lane runs past the junction at its other end, that lane keeps only its first metres, and the length
    of the whole edge, a mean over its lanes, is wrong with it: vehicles would drive into each other.
    """
    tree = ElementTree.parse(net_file)
    repaired: set[str] = set()
    for edge in tree.getroot().iter("edge"):
        lanes = edge.findall("lane")
        if edge.get("function") == "internal" or len(lanes) < 2:
            continue
        shapes = [_shape(lane) for lane in lanes]
        longest_m = max(map(length_m, shapes))
        truncated = [index for index, shape in enumerate(shapes) if length_m(shape) < SHORT * longest_m]
        for index in truncated:
            whole_lane = min(set(range(len(lanes))) - set(truncated), key=lambda other: abs(other - index))
            width_m = float(lanes[index].get("width", "3.2"))
            shapes[index] = _beside(shapes[whole_lane], (index - whole_lane) * width_m)
            lanes[index].set("shape", shape_text(shapes[index]))
            repaired.add(str(lanes[index].get("id")))
        if truncated:
            mean_m = np.mean([length_m(shape) for shape in shapes])
            for lane in lanes:
                lane.set("length", f"{mean_m:.2f}")
    if repaired:
        _reconnect(tree.getroot(), repaired)
        tree.write(net_file, encoding="utf-8", xml_declaration=True)
    return len(repaired)


def _reconnect(net: ElementTree.Element, repaired: set[str]) -> None:
    """Reconnect lanes over junctions straight to the new ends of repaired lanes."""
    lanes = {str(lane.get("id")): lane for lane in net.iter("lane")}
    for link in net.iter("connection"):
        start = f"{link.get('from')}_{link.get('fromLane')}"
        end = f"{link.get('to')}_{link.get('toLane')}"
        via = lanes.get(link.get("via", ""))
        if via is not None and {start, end} & repaired:
            shape = np.stack([_shape(lanes[start])[-1], _shape(lanes[end])[0]])
            via.set("shape", shape_text(shape))
            via.set("length", f"{max(length_m(shape), 0.1):.2f}")


def _shape(lane: ElementTree.Element) -> Float64:
    return parse_shape(lane.get("shape", ""))


def _beside(shape_m: Float64, left_m: float) -> Float64:
    along = np.gradient(shape_m[:, :2], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    moved = shape_m.copy()
    moved[:, :2] += left_m * np.column_stack([-along[:, 1], along[:, 0]])
    return moved

"""Checks of a SUMO network's numbers and shapes before SUMO or the world uses them."""

from __future__ import annotations

import math
import reprlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.simulate.road_network.shape import length_m, parse_shape

ANYWHERE = (-1e8, 1e8)
"""Metres: wider than UTM coordinates of any place on Earth."""

MOST_LANES_KM = 5000.0
"""The world of a network with longer lanes needs tens of gigabytes."""

LONGEST_CURVE_M = 1e5
MOST_ROADS_M = 5e6
MOST_OBJECTS = 1e6
"""Limits of an OpenDRIVE map: netconvert holds a point for every two metres of a curve, and all objects."""

NUMBERS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "lane": {"index": (0, 1000), "speed": (0, 1000), "length": (0.001, 1e6), "width": (0.01, 200)},
    "junction": {"x": ANYWHERE, "y": ANYWHERE, "z": ANYWHERE},
    "connection": {"fromLane": (0, 1000), "toLane": (0, 1000)},
}
"""The least and greatest allowed values of attributes that are given; in metres and m/s."""

NEEDED: Mapping[str, tuple[str, ...]] = {
    "location": ("netOffset", "convBoundary", "origBoundary", "projParameter"),
    "edge": ("id",),
    "lane": ("id", "index", "speed", "length", "shape"),
    "junction": ("id", "type", "x", "y", "incLanes", "intLanes"),
    "connection": ("from", "to", "fromLane", "toLane", "dir", "state"),
}
"""Required attributes of elements."""


def check_network(net: ElementTree.Element, origin: str) -> None:
    """Raise AdvpipeError, naming the element, for anything on which SUMO or the world would fail.

    net: the root of a `.net.xml`. It checks for missing attributes, numbers out of bounds,
    invalid shapes, and duplicate ids of edges, lanes or junctions. origin: the file's name in messages.
    """
    incomplete = "so it is not a complete SUMO network; run netconvert"
    if "version" not in net.attrib:
        raise AdvpipeError(f"{origin}: <net> has no version, {incomplete}")
    if net.find("location") is None:
        raise AdvpipeError(f"{origin}: <net> has no <location>, {incomplete}")
    if not any(not edge.get("id", ":").startswith(":") for edge in net.iter("edge")):
        raise AdvpipeError(f"{origin}: the network contains no road")
    seen: set[tuple[str, str]] = set()
    total_m = 0.0
    for element in net.iter():
        for problem in _problems(element):
            raise AdvpipeError(f"{origin}: {_name(element)} {problem}")
        if element.tag in ("edge", "lane", "junction"):
            key = (element.tag, element.attrib["id"])
            if key in seen:
                raise AdvpipeError(f"{origin}: {_name(element)} occurs twice; each id must be unique")
            seen.add(key)
            total_m += length_m(parse_shape(element.get("shape", "")))
    if total_m > 1000 * MOST_LANES_KM:
        raise AdvpipeError(
            f"{origin}: its lanes and outlines are {total_m / 1000:.0f} km long; at most "
            f"{MOST_LANES_KM:.0f} km are supported; reduce the map with netconvert --keep-edges.in-boundary"
        )


def check_opendrive(root: ElementTree.Element, origin: str) -> None:
    """Raise AdvpipeError for a map on which netconvert would need hours or all memory.

    It samples all curves, and creates each object as often as it is repeated.
    """
    total_m = objects = 0.0
    for element in root.iter():
        tag = element.tag.rpartition("}")[2]
        if tag not in ("geometry", "repeat"):
            continue
        length_m, every_m = (_number(element.get(name, "0")) for name in ("length", "distance"))
        if not abs(length_m) <= LONGEST_CURVE_M:
            raise AdvpipeError(
                f"{origin}: a <{tag}> has the length {reprlib.repr(element.get('length'))}, not a number of "
                f"metres up to {LONGEST_CURVE_M:g}"
            )
        if tag == "geometry":
            total_m += abs(length_m)
        elif every_m >= 0:
            objects += abs(length_m) / (every_m or 1.0)
        else:
            raise AdvpipeError(
                f"{origin}: a <repeat> has the distance {reprlib.repr(element.get('distance'))}, not a "
                "number of metres"
            )
    if total_m > MOST_ROADS_M or objects > MOST_OBJECTS:
        raise AdvpipeError(
            f"{origin}: {total_m / 1000:.0f} km of roads with {objects:.0f} repeated objects; at most "
            f"{MOST_ROADS_M / 1000:.0f} km and {MOST_OBJECTS:.0f} are read"
        )


def _problems(element: ElementTree.Element) -> Iterator[str]:
    """The problems of one element, each as the end of a sentence that its name begins."""
    for name in NEEDED.get(element.tag, ()):
        if name not in element.attrib:
            yield f"has no {name}"
    for name, (least, greatest) in NUMBERS.get(element.tag, {}).items():
        text = element.get(name)
        if text is not None and not least <= _number(text) <= greatest:
            yield f"has {name} {reprlib.repr(text)}, not a number from {least:g} to {greatest:g}"
    if element.tag == "location":
        offset = element.attrib["netOffset"].split(",")
        if len(offset) != 2 or not all(abs(_number(text)) <= ANYWHERE[1] for text in offset):
            yield f"has netOffset {reprlib.repr(element.attrib['netOffset'])}, not two numbers of metres"
    if element.tag in ("edge", "lane", "junction"):
        yield from _shape_problems(element)


def _shape_problems(element: ElementTree.Element) -> Iterator[str]:
    text = element.get("shape", "")
    try:
        shape_m = parse_shape(text)
    except ValueError:
        yield f"has the shape {reprlib.repr(text)}, which is not a list of x,y or x,y,z"
        return
    if not (np.abs(shape_m) <= ANYWHERE[1]).all():  # false for NaN, too
        yield f"has a shape with a coordinate that is not a number from {ANYWHERE[0]:g} to {ANYWHERE[1]:g}"
    if element.tag == "lane" and len(shape_m) < 2:
        yield f"has a shape of {len(shape_m)} points; a lane needs at least two"


def _number(text: str) -> float:
    """The number in a text; NaN for any other text."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _name(element: ElementTree.Element) -> str:
    if element.tag == "connection":
        return f"<connection> from {reprlib.repr(element.get('from'))} to {reprlib.repr(element.get('to'))}"
    known = element.get("id")
    return f"<{element.tag}>" if known is None else f"{element.tag} {reprlib.repr(known)}"

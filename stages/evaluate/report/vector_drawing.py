"""The SVG drawings of a report as matplotlib figures, which can be saved as PDF."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple
from xml.etree import ElementTree

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Transform
from PIL import Image, UnidentifiedImageError

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.figure import Figure

SVG, LINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}href"
GROUP, USE, PATH, RECTANGLE, IMAGE = (f"{SVG}{name}" for name in ("g", "use", "path", "rect", "image"))
POINTS_PER_INCH = 72
MOST_POINTS = 14_400
"""Width and height of a drawing, at most, as in a PDF."""

_CODES: Mapping[str, list[int]] = {
    "M": [int(Path.MOVETO)],
    "L": [int(Path.LINETO)],
    "Q": [int(Path.CURVE3)] * 2,
    "C": [int(Path.CURVE4)] * 3,
    "z": [int(Path.CLOSEPOLY)],
}

Caps = Literal["butt", "projecting", "round"]
CAPS: Mapping[str, Caps] = {"butt": "butt", "square": "projecting", "round": "round"}


class Shape(NamedTuple):
    """A path or an image, with what its own element and those around it say of it."""

    element: ElementTree.Element
    transform: Transform
    style: Mapping[str, str]
    clip: str


def figure_of_svg(svg: bytes) -> Figure:
    """The drawing as a figure of its size; its texts are outlines, as in the SVG.

    Raises AdvpipeError for an SVG that matplotlib did not write, or wrote with texts.
    """
    try:
        if b"<!ENTITY" in svg:
            raise ValueError("it declares entities")
        return _drawn(ElementTree.fromstring(svg))
    except (
        *(ElementTree.ParseError, Image.DecompressionBombError, UnidentifiedImageError),
        *(AttributeError, LookupError, OverflowError, RecursionError, TypeError, ValueError),
    ) as error:
        raise AdvpipeError(f"not a drawing by matplotlib: {error}") from None


def _drawn(root: ElementTree.Element) -> Figure:
    _, _, width, height = map(float, root.attrib["viewBox"].split())
    if not (0 < width <= MOST_POINTS and 0 < height <= MOST_POINTS):
        raise ValueError(f"it is {width:g} by {height:g} points large")
    figure = Figure(figsize=(width / POINTS_PER_INCH, height / POINTS_PER_INCH))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    named = {each.attrib["id"]: each for each in root.iter() if "id" in each.attrib}
    with rc_context({"lines.scale_dashes": False}):  # they are in points, not in widths of their line
        for order, shape in enumerate(_shapes(root, named, Shape(root, Affine2D(), {}, ""))):
            artist: Artist = _image(axes, shape) if shape.element.tag == IMAGE else _patch(axes, shape)
            artist.set_zorder(order)
            clip = _path(named[shape.clip][0]) if shape.clip else None
            artist.set_clip_path(clip, axes.transData if clip else None)
    axes.set(xlim=(0, width), ylim=(height, 0), aspect="auto")
    return figure


def _shapes(
    parent: ElementTree.Element, named: Mapping[str, ElementTree.Element], outer: Shape
) -> Iterator[Shape]:
    """All paths and images within an element, in the order in which they are drawn."""
    for each in parent:
        if each.tag not in (GROUP, USE, PATH, IMAGE) or (each.tag == PATH and "d" not in each.attrib):
            continue
        clip = each.get("clip-path", "").removeprefix("url(#").removesuffix(")") or outer.clip
        own = Shape(each, _transform(each) + outer.transform, {**outer.style, **_style(each)}, clip)
        if each.tag == GROUP:
            yield from _shapes(each, named, own)
        elif each.tag == USE:
            used = named[each.attrib[LINK].removeprefix("#")]
            if "d" not in used.attrib:  # a space
                continue
            shift = Affine2D().translate(float(each.get("x", "0")), float(each.get("y", "0")))
            style = {**_style(used), **own.style}
            yield Shape(used, _transform(used) + shift + own.transform, style, clip)
        else:
            yield own


def _patch(axes: Axes, shape: Shape) -> PathPatch:
    style = shape.style
    opacity = float(style.get("opacity", "1"))
    fill, stroke = style.get("fill", "#000000"), style.get("stroke", "none")
    dashes = style.get("stroke-dasharray", "none")
    offset = float(style.get("stroke-dashoffset", "0"))
    patch = PathPatch(
        shape.transform.transform_path(_path(shape.element)),
        facecolor="none" if fill == "none" else (fill, opacity * float(style.get("fill-opacity", "1"))),
        edgecolor="none" if stroke == "none" else (stroke, opacity * float(style.get("stroke-opacity", "1"))),
        linewidth=0 if stroke == "none" else float(style.get("stroke-width", "1")),
        linestyle="-" if dashes == "none" else (offset, tuple(map(float, dashes.split(",")))),
        capstyle=CAPS[style.get("stroke-linecap", "butt")],
        joinstyle="miter" if style.get("stroke-linejoin") == "miter" else "round",
    )
    axes.add_artist(patch)
    return patch


def _image(axes: Axes, shape: Shape) -> Artist:
    element = shape.element
    media, _, encoded = element.attrib[LINK].partition(",")
    if media != "data:image/png;base64":
        raise ValueError(f"an image is {media!r}")
    x, y, width, height = (float(element.attrib[name]) for name in ("x", "y", "width", "height"))
    (left, top), (right, bottom) = shape.transform.transform([(x, y), (x + width, y + height)])
    with Image.open(io.BytesIO(base64.b64decode(encoded)), formats=["PNG"]) as picture:
        pixels = np.asarray(picture.convert("RGBA"))
    return axes.imshow(pixels, extent=(left, right, bottom, top), interpolation="none")


def _path(element: ElementTree.Element) -> Path:
    """The path of a `path` or of a `rect`, in its own coordinates."""
    if element.tag == RECTANGLE:
        x, y, width, height = (float(element.attrib[name]) for name in ("x", "y", "width", "height"))
        return Path.unit_rectangle().transformed(Affine2D().scale(width, height).translate(x, y))
    points: list[tuple[float, float]] = []
    codes: list[int] = []
    for command, numbers in re.findall(r"([A-Za-z])([^A-Za-z]*)", element.attrib["d"]):
        coordinates = [float(each) for each in numbers.split()] or [0.0, 0.0]
        codes += _CODES[command]
        points += zip(coordinates[::2], coordinates[1::2], strict=True)
    return Path(points or np.empty((0, 2)), codes or None)


def _style(element: ElementTree.Element) -> dict[str, str]:
    entries = (each.split(":", 1) for each in element.get("style", "").split(";") if each.strip())
    return {name.strip(): value.strip() for name, value in entries}


def _transform(element: ElementTree.Element) -> Transform:
    """What the element's attribute says: the last of its parts is carried out first."""
    found = Affine2D()
    for name, numbers in reversed(re.findall(r"(\w+)\(([^)]*)\)", element.get("transform", ""))):
        values = [float(each) for each in re.split(r"[ ,]+", numbers.strip())]
        match name, values:
            case "translate", [x, y]:
                found.translate(x, y)
            case "scale", [factor]:
                found.scale(factor)
            case "scale", [x, y]:
                found.scale(x, y)
            case "rotate", [angle_deg]:
                found.rotate_deg(angle_deg)
            case "matrix", [a, b, c, d, e, f]:
                found.set_matrix(Affine2D.from_values(a, b, c, d, e, f).get_matrix() @ found.get_matrix())
            case _:
                raise ValueError(f"a transform is {name}({numbers})")
    return found

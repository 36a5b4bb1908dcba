"""Drawings on dark pages: neutral colours change, meanings keep theirs."""

from __future__ import annotations

import base64
import io
import re
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
from PIL import Image

from advpipe.pipeline.core.figure import Figure
from advpipe.stages.evaluate.report.pictures import to_svg
from advpipe.stages.evaluate.report.style import DISPLACED, INK, LOST
from advpipe.stages.evaluate.report.themed_svg import DARK, svg_uri, themed_svg


def drawing() -> bytes:
    figure = Figure(figsize=(2, 2), facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.plot([0, 1], [0, 1], color=INK)
    axes.plot([0, 1], [1, 0], color=LOST)
    axes.scatter([0.2], [0.7], s=400, color="#4a5766", rasterized=True)
    axes.scatter([0.7], [0.7], s=400, color="#c2189b", rasterized=True)
    return to_svg(figure)


def test_a_dark_page_changes_ink_and_paper_and_keeps_orange() -> None:
    page = themed_svg(drawing()).decode()
    style = page[page.index("<style>") : page.index("</style>")]
    light, dark = style.split("@media screen and (prefers-color-scheme:dark){")
    for property_, colour in (("stroke", INK), ("fill", "#ffffff")):
        (name,) = re.findall(rf"(\.s\d+){{[^}}]*{property_}:{colour}", light)
        assert re.search(rf"{re.escape(name)}{{[^}}]*{property_}:{DARK[colour]}", dark)
        assert f'class="{name[1:]}"' in page
    assert LOST not in DARK
    assert LOST in light
    assert LOST not in dark


def test_it_stands_in_an_attribute_and_in_a_srcset() -> None:
    uri = svg_uri(themed_svg(drawing()))
    assert not set(uri) & set('" #')
    text = unquote(uri.removeprefix("data:image/svg+xml,"))
    paths = [each for each in ElementTree.fromstring(text).iter() if each.tag.endswith("path")]
    as_drawn = [each for each in ElementTree.fromstring(drawing()).iter() if each.tag.endswith("path")]
    assert len(paths) == len(as_drawn) > 2
    for short, long in zip(paths, as_drawn, strict=True):
        numbers = [[float(n) for n in re.findall(r"-?[\d.]+", each.get("d"))] for each in (short, long)]
        np.testing.assert_allclose(*numbers, atol=0.1)


def test_displaced_stays_teal() -> None:
    """More green and blue than red, as on white."""
    red, green, blue = (int(DARK[DISPLACED][place : place + 2], 16) for place in (1, 3, 5))
    assert min(green, blue) > red


def test_grey_and_coloured_points_are_apart_in_few_colours() -> None:
    found = re.findall(rb'<image class="(\w+)"[^>]*base64,([^"]+)"', themed_svg(drawing()))
    assert [name for name, _ in found] == [b"grey", b"coloured"]
    for name, content in found:
        pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(content))).convert("RGBA")).astype(int)
        solid = pixels[pixels[..., 3] > 200][:, :3]
        spread = np.median(solid.max(axis=1) - solid.min(axis=1))
        assert len(np.unique(solid, axis=0)) <= 32
        assert (spread < 51) == (name == b"grey")


def test_coordinates_are_shorter_and_scales_are_not() -> None:
    before, after = drawing(), themed_svg(drawing())
    before_scales, after_scales = (set(re.findall(rb"scale\([^)]*\)", each)) for each in (before, after))
    assert before_scales == after_scales
    assert not re.search(rb' d="[^"]*\.\d{3}', after)

"""The SVG drawings of a report as the page embeds them: small, and with colours for a dark page, too.

A browser draws an SVG in an `<img>` by its own style sheet, which knows whether the page is dark.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from io import BytesIO

import numpy as np
from PIL import Image

DARK: Mapping[str, str] = {
    "#ffffff": "#161f28", "#1b2430": "#e8edf3", "#000000": "#e8edf3", "#556170": "#a3b0bf",
    "#5c6876": "#a3b0bf", "#7b8794": "#94a1af", "#808080": "#94a1af", "#c9d1da": "#465362",
    "#dbe1e8": "#2f3b48", "#eceff3": "#27323d", "#eef1f5": "#2b3743", "#fbe3e4": "#43232a",
    "#1d5fd1": "#5f9bff", "#d61f26": "#ff5d62", "#a85a00": "#ffae3d", "#0a7f7f": "#2fd4c7",
    "#0b8a8a": "#2fd4c7", "#c26a00": "#ff9d3d", "#7a3ff2": "#ab8cff", "#c2189b": "#f56ad3",
}  # fmt: skip
"""The colour on a dark page for each colour of the drawings that is made for white paper; hues are kept."""

GREY_BELOW = 0.2
"""The largest difference between the colour components, in [0, 1], of a pixel that counts as grey."""

COLOURS = 32

SHARE = 75
"""The size of an image in the page, in per cent of that in the file."""

_IMAGE = re.compile(rb'<image [^>]*?xlink:href="data:image/png;base64,([^"]+)"[^>]*?/>', re.DOTALL)
_STYLED = re.compile(rb'(<(?:path|g|use|rect)\b[^>]*?) style="([^"]*)"')
_COLOUR = re.compile(r"#[0-9a-f]{6}")
_NUMBERS = re.compile(rb' (?:d|x|y)="[^"]*"|translate\([^)]*\)')


def themed_svg(svg: bytes) -> bytes:
    """matplotlib's drawing with a style for dark pages, and its images in few colours, grey ones apart."""
    svg = re.sub(rb"<metadata>.*?</metadata>", b"", svg, count=1, flags=re.DOTALL)
    head, start, body = svg.partition(b"<defs>")
    styles: dict[str, str] = {}

    def to_class(found: re.Match[bytes]) -> bytes:
        name = styles.setdefault(found[2].decode(), f"s{len(styles)}")
        return found[1] + b' class="' + name.encode() + b'"'

    body = _NUMBERS.sub(_rounded, _STYLED.sub(to_class, _IMAGE.sub(_split, body)))
    plain = "".join(f".{name}{{{_short(style)}}}" for style, name in styles.items())
    # Texts without a colour are black. Points are darker the higher they are, and brighter on a dark page.
    dark = f"svg{{fill:{DARK['#000000']}}}.grey{{filter:invert(1) hue-rotate(180deg)}}"
    dark += ".coloured{filter:brightness(1.25)}"
    dark += "".join(
        f".{name}{{{_short(_COLOUR.sub(lambda found: DARK.get(found[0], found[0]), style))}}}"
        for style, name in styles.items()
        if any(colour in DARK for colour in _COLOUR.findall(style))
    )
    style = f"<style>{plain}@media screen and (prefers-color-scheme:dark){{{dark}}}</style>"
    return head + style.encode() + start + body


def _short(style: str) -> str:
    """The style without what a browser does anyway."""
    return re.sub(r"\s+|stroke-dashoffset:\s*0;?|stroke-linejoin:\s*miter;?", "", style)


def svg_uri(svg: bytes) -> str:
    """The drawing as a `data:` address that stands between double quotes; a third shorter than base64."""
    text = re.sub(r"\s+", " ", svg.decode()).replace("> <", "><").replace('"', "'")
    text = re.sub(r"(?<=[\d']) ?([MLQCz]) ?", r"\1", text)
    text = re.sub(r"(?<=\d) (?=[-\d])", ",", text)
    # A `srcset` ends an address at a space, and takes one that ends with a comma for two.
    return "data:image/svg+xml," + text.replace("%", "%25").replace("#", "%23").replace(" ", "%20")


def _rounded(found: re.Match[bytes]) -> bytes:
    """Coordinates to tenths of a point."""
    return re.sub(rb"(\.\d)\d+", rb"\1", found[0]).replace(b".0 ", b" ")


def _split(found: re.Match[bytes]) -> bytes:
    """Two images in place of one: the grey pixels and the coloured ones."""
    with Image.open(BytesIO(base64.b64decode(found[1]))) as picture:
        pixels = np.asarray(picture.convert("RGBA"))
    rgb = pixels[..., :3].astype(np.float32) / 255
    is_grey = rgb.max(axis=2) - rgb.min(axis=2) < GREY_BELOW
    parts = []
    for name, chosen in ((b"grey", is_grey), (b"coloured", ~is_grey)):
        part = np.where(chosen[..., None], pixels, 0)
        if part[..., 3].any():
            element = found[0].replace(
                b"png;base64," + found[1], b"webp;base64," + base64.b64encode(_webp(part))
            )
            parts.append(element.replace(b"<image ", b'<image class="' + name + b'" ', 1))
    return b"".join(parts)


def _webp(pixels: np.ndarray) -> bytes:
    """The pixels in few colours, without a further loss."""
    stream = BytesIO()
    size = (pixels.shape[1] * SHARE // 100, pixels.shape[0] * SHARE // 100)
    few = (
        Image.fromarray(pixels)
        .resize(size, Image.Resampling.BOX)
        .quantize(COLOURS, Image.Quantize.FASTOCTREE)
        .convert("RGBA")
    )
    few.save(stream, "WEBP", lossless=True, quality=50, method=4)
    return stream.getvalue()

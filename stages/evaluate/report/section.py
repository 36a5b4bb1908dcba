"""The parts of a report: each family of attacks contributes sections of tables, pictures and records."""

from __future__ import annotations

import base64
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import BytesIO
from typing import NamedTuple

from advpipe.pipeline.results.listed import Listed
from advpipe.stages.evaluate.report.themed_svg import svg_uri, themed_svg

OVERVIEW, CLEAN, ATTACK, SECTION, FIRST_SCREEN = "overview", "clean", "attack", "section", "first-screen"
"""The parts of a report that pictures are in."""


class Formula(NamedTuple):
    """The meaning of some values. name: among the formulas in `report.json`; title: as people name it.
    keys: those that have the values in `report.json`; `*` stands for a class, a criterion or a baseline."""

    name: str
    meaning: str
    keys: tuple[str, ...] = ()
    title: str = ""


@dataclass(frozen=True)
class Table:
    """A table of text: a title, column heads, lines of as many cells, and what the columns mean.

    is_detail: of use to few readers; the page shows it when it is asked for.
    """

    title: str
    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]
    note: str = ""
    is_detail: bool = False


MOST_SVG_BYTES = 600_000
"""The page shows a picture as PNG, white on dark pages, too, where its SVG is larger."""


@dataclass(frozen=True)
class ReportPicture:
    """One picture of the report, as PNG and, where it was drawn by this report, as SVG.

    bag: whose clouds it shows; in a clean section, the first bag with these frames. file_name: of the PNG.
    is_worst: shows the worst frame of its bag.
    """

    section: str
    bag: str
    file_name: str
    caption: str
    png: bytes
    is_wide: bool = True
    svg: bytes = b""
    is_worst: bool = False

    @property
    def data_uri(self) -> str:
        """The picture for the page, which shows it without another file."""
        svg = themed_svg(self.svg) if self.svg else b""
        if 0 < len(svg) <= MOST_SVG_BYTES:
            return svg_uri(svg)
        return "data:image/png;base64," + base64.b64encode(_palette_png(self.png)).decode("ascii")

    @property
    def aspect(self) -> float:
        """Width by height."""
        width, height = map(int, struct.unpack(">II", self.png[16:24]))
        return round(width / height, 4)

    @property
    def files(self) -> dict[str, bytes]:
        """Each format that there is, by its file's name."""
        stem = self.file_name.removesuffix(".png")
        formats = {self.file_name: self.png, f"{stem}.svg": self.svg}
        return {name: content for name, content in formats.items() if content}


def _palette_png(png: bytes) -> bytes:
    """The picture in 128 colours, a third of the size; as it is where that is smaller."""
    from PIL import Image

    small = BytesIO()
    with Image.open(BytesIO(png)) as picture:
        picture.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
    return min(png, small.getvalue(), key=len)


@dataclass(frozen=True)
class ReportSection:
    """A part of a report that stands by itself.

    key: under which `report.json` lists the records, unique in a report. lead: what the tables show, in a
    sentence or two. terminal: the main values, in tables for 80 characters. records: one for each line in
    `report.json`. formulas: what the values mean. files: further files of the report by name.
    """

    key: str
    title: str
    lead: str = ""
    tables: tuple[Table, ...] = ()
    pictures: tuple[ReportPicture, ...] = ()
    records: tuple[Listed, ...] = ()
    notes: tuple[str, ...] = ()
    formulas: tuple[Formula, ...] = ()
    terminal: tuple[Table, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)

"""What a report is built of: each family of attacks contributes sections of tables, pictures and records."""

from __future__ import annotations

import base64
from dataclasses import dataclass

from advpipe.pipeline.results.listed import Listed

OVERVIEW, CLEAN, ATTACK, SECTION = "overview", "clean", "attack", "section"
"""The parts of a report that pictures are in."""


@dataclass(frozen=True)
class Table:
    """A table of words: a title, column heads, and lines of as many cells."""

    title: str
    heads: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class ReportPicture:
    """One PNG of the report.

    bag: whose clouds it shows; in a clean section, the first bag with these frames.
    """

    section: str
    bag: str
    file_name: str
    caption: str
    png: bytes
    is_wide: bool = True

    @property
    def data_uri(self) -> str:
        return "data:image/png;base64," + base64.b64encode(self.png).decode("ascii")


@dataclass(frozen=True)
class ReportSection:
    """A part of a report that stands by itself.

    key: under which `report.json` lists the records, and no other section has. lead: what the tables show,
    in a sentence or two. records: one a line of `report.json`. formulas: what its figures mean.
    """

    key: str
    title: str
    lead: str = ""
    tables: tuple[Table, ...] = ()
    pictures: tuple[ReportPicture, ...] = ()
    records: tuple[Listed, ...] = ()
    notes: tuple[str, ...] = ()
    formulas: tuple[tuple[str, str], ...] = ()

"""Where an imported drive comes from, as its bag records it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import Document, ShortText, Text, read_yaml


class RecordedSource(Document):
    """The part of a bag's record of its source that cards, exports and further imports need.

    attacker_files: of a log of beacons, files that were not imported, whose names say who attacks.
    """

    form: ShortText = ""
    name: ShortText = ""
    licence: ShortText | None = None
    citation: Text = ""
    labels: ShortText = ""
    attacker_files: Annotated[tuple[ShortText, ...], Field(max_length=100_000)] = ()


def read_source(bag: Path) -> RecordedSource | None:
    """The source of an imported bag; None for another one. Raises AdvpipeError for an invalid record."""
    text = BagReader(bag).provenance.fields.source
    if not text.strip():
        return None
    where = f"{bag}: the provenance record: source"
    found: RecordedSource = read_yaml(text, RecordedSource, where, "import the drive again")
    return found

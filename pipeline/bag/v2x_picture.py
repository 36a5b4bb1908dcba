"""The V2X of a recorded drive as a picture."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.v2x_statistics import read_statistics
from advpipe.pipeline.core.atomic_file import atomic_file
from advpipe.pipeline.core.errors import OutputExistsError, UsageError, writing
from advpipe.pipeline.v2x.plot import draw_statistics

FORMATS = (".png", ".pdf", ".svg")
DOTS_PER_INCH = 150


def draw_bag(bag: Path, out: Path, overwrite: bool = False) -> None:
    """Draws the statistics in a bag into a file, whole or not at all.

    Raises AdvpipeError for a bag without V2X, a file that exists, and a kind of file that is none.
    """
    if out.suffix.lower() not in FORMATS:
        raise UsageError(f"{out} is not a picture; use one of the extensions {', '.join(FORMATS)}")
    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    reader = BagReader(resolve_bag(bag))
    statistics = read_statistics(reader)
    if statistics is None:
        raise UsageError(f"{reader.path} has no V2X statistics; simulate a drive with v2x.enabled")
    figure = draw_statistics(statistics, reader.provenance.get("scenario_name", ""))
    form = out.suffix.lower()
    with writing(out), atomic_file(out) as beside:
        figure.savefig(beside, format=form[1:], dpi=DOTS_PER_INCH, metadata=_NO_DATE.get(form))


_NO_DATE = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""The same bag, the same picture, to the byte."""

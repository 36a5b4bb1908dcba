"""The V2X of a recorded drive as a picture."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.v2x_statistics import read_statistics
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.picture_file import refuse_picture, save_picture
from advpipe.pipeline.v2x.plot import draw_statistics


def draw_bag(bag: Path, out: Path, overwrite: bool = False) -> None:
    """Draws the statistics in a bag into a file, whole or not at all.

    Raises AdvpipeError for a bag without V2X, a file that exists, and a kind of file that is none.
    """
    refuse_picture(out, overwrite)
    reader = BagReader(resolve_bag(bag))
    statistics = read_statistics(reader)
    if statistics is None:
        raise UsageError(
            f"{reader.path} has no V2X statistics; simulate a drive with v2x.enabled, or draw one of its "
            "clouds with --cloud FRAME"
        )
    save_picture(draw_statistics(statistics, reader.provenance.get("scenario_name", "")), out)

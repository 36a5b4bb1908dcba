"""The search for who lied as a function."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike, refuse_existing
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.progress import with_progress, working_on

if TYPE_CHECKING:
    from advpipe.stages.investigate.investigation import Investigation


@with_progress("investigating {bag}")
def investigate(
    bag: PathLike,
    *,
    vehicle: str | None = None,
    silence_s: float | None = None,
    page: PathLike | None = None,
    overwrite: bool = False,
) -> Investigation:
    """Find out which sensor or station lied in a drive, when, about what, and how sure that is.

    bag: a data set, a rosbag2 folder or an .mcap file. vehicle: whose sensors and received messages; by
    default `ego`, or the only one. silence_s: where stations change their pseudonyms, how long they fall
    silent at most before, 0 for not at all; a new id that continues a known station's way is then taken for
    it. page: also write the answer as HTML there; overwrite: replaces it. Reads only what that vehicle had on
    board. Raises UsageError for a bag with nothing to judge, for an unknown vehicle and for a silence beyond
    a minute, and AdvpipeError for a damaged bag.

    >>> advpipe.investigate("datasets/smoke").suspects
    ()
    """
    if page is not None:
        refuse_existing(Path(page), overwrite)
    with working_on("loading libraries"):
        from advpipe.stages.investigate.run import investigate as run

    if silence_s is not None and not 0 <= silence_s <= 60:
        raise UsageError(f"silence_s must be from 0 to 60 s, not {silence_s:g}")
    found = run(Path(bag), vehicle=vehicle, silence_s=silence_s)
    if page is not None:
        from advpipe.pipeline.core.atomic_file import write_new
        from advpipe.stages.investigate.page import investigation_page

        write_new(Path(page), investigation_page(found, Path(bag).name), overwrite)
    return found

"""The search for who lied as a function."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike, refuse_existing
from advpipe.pipeline.core.progress import with_progress, working_on

if TYPE_CHECKING:
    from advpipe.stages.investigate.investigation import Investigation


@with_progress("investigating {bag}")
def investigate(
    bag: PathLike, *, vehicle: str | None = None, page: PathLike | None = None, overwrite: bool = False
) -> Investigation:
    """Find out which sensor or station lied in a drive, when, about what, and how sure that is.

    bag: a data set, a rosbag2 folder or an .mcap file. vehicle: whose sensors and received messages; by
    default `ego`, or the only one. page: also write the answer as HTML there; overwrite: replaces it. Reads
    only what that vehicle had on board. Raises UsageError for a bag with nothing to judge and for an unknown
    vehicle, and AdvpipeError for a damaged bag.

    >>> advpipe.investigate("datasets/smoke").suspects
    ()
    """
    if page is not None:
        refuse_existing(Path(page), overwrite)
    with working_on("loading libraries"):
        from advpipe.stages.investigate.run import investigate as run

    found = run(Path(bag), vehicle=vehicle)
    if page is not None:
        from advpipe.pipeline.core.atomic_file import write_new
        from advpipe.stages.investigate.page import investigation_page

        write_new(Path(page), investigation_page(found, Path(bag).name), overwrite)
    return found

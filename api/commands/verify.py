"""The checks of a data set as a function."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import PathLike
from advpipe.pipeline.core.progress import with_progress, working_on

if TYPE_CHECKING:
    from advpipe.stages.verify.result import Verification


@with_progress("verifying {path}")
def verify(path: PathLike, *, quick: bool = False, key: PathLike | None = None) -> Verification:
    """Check everything that a data set, a bag, an .mcap file or an archive of `share` claims.

    quick: checksums and signature alone. key: the signer's public key (PEM). Nothing is changed; memory stays
    flat whatever the size. Returns the findings, and what could not be checked. Raises UsageError for a path
    that names none of them, and for a key that is none.

    >>> advpipe.verify("datasets/smoke").is_good
    True
    """
    with working_on("loading libraries"):
        from advpipe.stages.verify.run import verify as run

    return run(Path(path), quick=quick, key=None if key is None else Path(key))

"""What a report of a data set says it is about."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from advpipe.pipeline.errors import AdvpipeError

LIMIT_BYTES = 1 << 24
"""The longest report that is read: one of a drive of five minutes has 0.2 MB."""


def read_report(path: Path) -> dict[str, Any]:
    """A report.json; raises AdvpipeError for a file that is none, or that cannot be read."""
    try:
        if path.stat().st_size > LIMIT_BYTES:
            raise AdvpipeError(f"{path} is too large for a report")
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise AdvpipeError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (ValueError, RecursionError):
        raise AdvpipeError(f"{path} is no JSON; evaluate again with --overwrite") from None
    if not isinstance(document, dict):
        raise AdvpipeError(f"{path} is no report; evaluate again with --overwrite")
    return document


def bags_of_report(path: Path) -> dict[str, str]:
    """The SHA-256 (`parent_sha256`) of each bag that a report compared, by the bag's name.

    Of random baselines there are none. Raises AdvpipeError for a file that is no report.
    """
    document = read_report(path)
    try:
        origin = document["provenance"]
        stated = {Path(origin["clean"]["bag"]).name: str(origin["clean"]["sha256"])}
        compared = ((str(each["bag"]), each["sha256"]) for each in origin["compared"])
        return stated | {bag: str(sha256) for bag, sha256 in compared if sha256 is not None}
    except (LookupError, TypeError):
        raise AdvpipeError(f"{path} is no report: it does not say of which bags") from None

"""Licences by their SPDX identifiers."""

from __future__ import annotations

import re

from advpipe.pipeline.core.errors import UsageError

UNSTATED = "not stated (--licence), so the card cannot say it"

_SPDX = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+-]*(?: (?:AND|OR|WITH) [A-Za-z0-9][A-Za-z0-9.+-]*)*")


def check_licence(licence: str) -> None:
    """Raise UsageError for what is neither an SPDX identifier nor an expression of some."""
    if not _SPDX.fullmatch(licence):
        raise UsageError(
            f"licence {licence!r} is not an SPDX identifier, such as CC-BY-4.0 or LicenseRef-mine "
            "(https://spdx.org/licenses)"
        )


def licence_line(licence: str | None) -> str:
    """The line on the licence of what was imported; None: nobody stated it."""
    return f"licence: {licence or UNSTATED}"

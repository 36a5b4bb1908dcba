"""Standard error without what a command says of its progress."""

from __future__ import annotations

import re


def without_progress(errors: str) -> str:
    """Drops the first word of a command, such as `verifying d ...`, and the later lines of its progress."""
    said = tuple(re.findall(r"^(.*) \.\.\.$", errors, re.MULTILINE))
    return "".join(line for line in errors.splitlines(keepends=True) if not (said and line.startswith(said)))

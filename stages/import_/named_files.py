"""Choosing a drive of a folder that holds several, and files that a table names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.option_names import option_name

_MOST_LISTED = 12


def chosen_drive(where: Path, kind: str, names: Sequence[str], chosen: str | None) -> str:
    """The chosen one of the drives of a source, or its only one; kind: what the source calls them.

    Raises UsageError that lists them where the choice is unknown or missing.
    """
    if chosen is None and len(names) == 1:
        return names[0]
    if chosen in names:
        return str(chosen)
    listed = ", ".join(names[:_MOST_LISTED])
    if len(names) > _MOST_LISTED:
        listed += f" and {len(names) - _MOST_LISTED} more"
    if chosen is None:
        option = option_name("drive", names[0])
        raise UsageError(f"{where} has {len(names)} {kind}s; choose one ({option}): {listed}")
    hint = suggestion(chosen, names)
    raise UsageError(f"{where} has no {kind} {chosen!r}; {hint + ' ' if hint else ''}it has {listed}")


def named_file(folder: Path, name: str, named_by: str) -> Path:
    """The file that a table names, relative to a folder. Raises UsageError for one outside or missing.

    named_by: the table, for the error.
    """
    parts = PurePosixPath(name).parts
    if not parts or PurePosixPath(name).is_absolute() or ".." in parts or "\0" in name:
        raise UsageError(f"{named_by} names the file {name!r}, which is outside of the data set")
    file = folder.joinpath(*parts)
    if not file.is_file():
        raise UsageError(
            f"{file} is missing, though {named_by} names it; complete the download, or unpack it"
        )
    return file

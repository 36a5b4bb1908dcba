"""Pictures for people and papers as files: PNG, PDF or SVG, the same bytes for the same figure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.core.atomic_file import atomic_file
from advpipe.pipeline.core.errors import OutputExistsError, UsageError, writing
from advpipe.pipeline.core.short_repr import short_repr

if TYPE_CHECKING:
    from advpipe.pipeline.core.figure import Figure

FORMATS = (".png", ".pdf", ".svg")
DOTS_PER_INCH = 150

_NO_DATE = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}


def picture_path(out: Path | None, form: str | None, default: str) -> Path:
    """The file to write: `out`, with the extension of the format where it has none; without `out`, `default`
    with that of the format, which is PNG if none is given.

    Raises UsageError for a format that is unknown, or another than the extension's.
    """
    if form is not None and f".{form.lower()}" not in FORMATS:
        known = ", ".join(each[1:] for each in FORMATS)
        raise UsageError(f"unknown format of pictures {short_repr(form)}; known: {known}")
    suffix = f".{form.lower()}" if form is not None else ""
    if out is None:
        return Path(f"{default}{suffix or FORMATS[0]}")
    if suffix and not out.suffix:
        return out.with_name(f"{out.name}{suffix}")
    if suffix and out.suffix.lower() != suffix:
        raise UsageError(f"{out} has another extension than the format {form}; leave out one of the two")
    return out


def refuse_picture(out: Path, overwrite: bool) -> None:
    """Raises AdvpipeError for a file that exists, unless it is to be replaced, and for an extension that is
    not one of a picture."""
    if out.suffix.lower() not in FORMATS:
        raise UsageError(f"{out} is not a picture; use one of the extensions {', '.join(FORMATS)}")
    if out.exists() and not overwrite:
        raise OutputExistsError(out)


def save_picture(figure: Figure, out: Path) -> None:
    """Writes the figure in the format of the file's extension, whole or not at all."""
    from matplotlib import rc_context

    suffix = out.suffix.lower()
    # Without a salt, the identifiers in an SVG would be other ones each time.
    with rc_context({"svg.hashsalt": "advpipe"}), writing(out), atomic_file(out) as beside:
        figure.savefig(beside, format=suffix[1:], dpi=DOTS_PER_INCH, metadata=_NO_DATE.get(suffix))

"""Where an imported drive comes from: its card names the form, the source's licence and its citation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from advpipe.pipeline.bag.recorded_source import RecordedSource
from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.share.options import ShareOptions


def with_source(options: ShareOptions, source: RecordedSource | None) -> ShareOptions:
    """The options with the source's licence and citation where the user gives none.

    Raises UsageError for another licence than the source's.
    """
    if source is None:
        return options
    if source.licence is not None and options.licence not in (None, source.licence):
        raise UsageError(
            f"--licence {options.licence}: the drive comes from {source.form} under {source.licence}; leave "
            "--licence out, or import the drive with the licence that you have for it"
        )
    return replace(
        options,
        licence=options.licence or source.licence,
        citation=options.citation or source.citation or None,
    )


def source_warnings(source: RecordedSource | None) -> Iterator[str]:
    """What the author has to settle before the drive of somebody else is published."""
    if source is None:
        return
    if source.licence is None:
        yield (
            f"the drive comes from {source.form} ({source.name}), whose licence is not recorded: share it "
            "only if you may"
        )
    else:
        yield f"the drive comes from {source.form} ({source.name}) under {source.licence}: share it only so"

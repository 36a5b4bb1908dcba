"""The bags that a training learns from and is scored on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from advpipe.commands.paths import PathLike
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.process.folder import refuse_undecodable


def training_bags(
    bags: Sequence[PathLike], validate: PathLike | None, out: PathLike
) -> tuple[tuple[Path, ...], Path | None]:
    """The bags to learn from, and the held-out one. Raises UsageError where they are none, or the same."""
    with as_usage_error():
        learned = tuple(resolve_bag(Path(bag)) for bag in bags)
        held_out = None if validate is None else resolve_bag(Path(validate))
    if held_out and held_out.resolve() in {bag.resolve() for bag in learned}:
        raise UsageError(f"{option_name('validate')} {validate} is also a training bag; name a held-out one")
    refuse_undecodable(*learned, held_out, Path(out))
    return learned, held_out

"""Lists of seeds as they are typed."""

from __future__ import annotations

import re

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.short_repr import short_repr

MOST_SEEDS_OF_DRIVES = 10_000
_RANGE = re.compile(r"(?P<first>[0-9]{1,18})(?:(?:-|\.\.)(?P<last>[0-9]{1,18}))?", re.ASCII)


def parse_seeds(text: str) -> tuple[int, ...]:
    """The seeds of a list such as `1-20,25`, each once. Raises UsageError for another text.

    >>> parse_seeds("1-3,7"), parse_seeds("1..3")
    ((1, 2, 3, 7), (1, 2, 3))
    """
    seeds: dict[int, None] = {}
    for part in text.split(","):
        found = _RANGE.fullmatch(part.strip())
        first, last = (int(found["first"]), int(found["last"] or found["first"])) if found else (1, 0)
        if first > last:
            raise UsageError(
                f"{option_name('seeds')} {short_repr(text)}: write numbers and ranges, such as 1-20,25"
            )
        if last - first >= MOST_SEEDS_OF_DRIVES or len(seeds) + last - first >= MOST_SEEDS_OF_DRIVES:
            raise UsageError(f"{option_name('seeds')}: more than {MOST_SEEDS_OF_DRIVES} drives; give fewer")
        seeds |= dict.fromkeys(range(first, last + 1))
    return tuple(seeds)

"""Lists of seeds as they are typed."""

from __future__ import annotations

import pytest

from advpipe.pipeline.campaigns.seeds import parse_seeds
from advpipe.pipeline.core.errors import UsageError


def test_lists_of_seeds() -> None:
    assert parse_seeds("3") == (3,)
    assert parse_seeds("1-3,7, 2") == (1, 2, 3, 7)
    assert parse_seeds("1..4") == (1, 2, 3, 4)
    for text in ("", "a", "3-1", "1,,2", "-1", "1.5", "1-", "\u0661"):
        with pytest.raises(UsageError, match=r"write numbers and ranges, such as 1-20,25$"):
            parse_seeds(text)
    for text in ("0-10000", "1-6000,10001-20000", "0-999999999999999999"):
        with pytest.raises(UsageError, match=r"more than 10000 drives; give fewer$"):
            parse_seeds(text)

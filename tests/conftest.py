"""What all tests share: oracles must be there on the integration server, and may be absent elsewhere."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

# Tests run side by side: threads of theirs would only be in each other's way.
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture
def missing_oracle() -> Callable[[str], None]:
    """Skips a test whose oracle is not installed, and says so; on the integration server it fails."""

    def give_up(what: str) -> None:
        if os.environ.get("CI"):
            pytest.fail(f"oracle missing: {what}")
        pytest.skip(f"oracle missing: {what}")

    return give_up

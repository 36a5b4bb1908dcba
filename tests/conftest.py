"""What all tests share: oracles must be there on the integration server, and may be absent elsewhere."""

from __future__ import annotations

import os
from collections.abc import Generator

import pytest

# Tests run side by side: threads of theirs would only be in each other's way.
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, None]:
    """On the integration server, an oracle's test that is skipped has failed."""
    outcome = yield
    report = outcome.get_result()  # type: ignore[attr-defined]
    if os.environ.get("CI") and report.skipped and item.get_closest_marker("oracle"):
        report.outcome, report.longrepr = "failed", f"oracle missing: {report.longrepr[-1]}"

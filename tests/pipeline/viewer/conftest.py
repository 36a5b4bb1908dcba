"""The browser that pages are opened in, and the scenes that they show."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))

from chromium import running_browser


@pytest.fixture(scope="module")
def browser():
    with running_browser() as found:
        yield found

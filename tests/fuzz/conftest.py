"""Tests of the fuzzer import it as `tests.fuzz`, as the command does."""

from __future__ import annotations

import sys
from pathlib import Path

if (root := str(Path(__file__).parents[2])) not in sys.path:
    sys.path.insert(0, root)

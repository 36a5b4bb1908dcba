"""Lets the tests of metrics import the frames that they share."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

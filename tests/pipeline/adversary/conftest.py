"""Tests of this folder use the detector of those of the attacks."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "stages" / "attack"))

"""The scenarios that come with advpipe; shells complete their names without loading the models."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def shipped_scenarios() -> dict[str, Path]:
    """The shipped scenarios: a mapping from name to file."""
    return {path.stem: path for path in sorted(shipped_folder().glob("*.yaml"))}


def shipped_folder() -> Path:
    """The folder of the shipped scenarios, with their road networks in `networks/`."""
    return Path(str(files("advpipe.scenarios")))

"""What is in a folder before and after a command that is killed there."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

from forked import Forks

OWN_TIMES = {"times.json"}
"""Files that differ from run to run."""


def copied(ready: Path, folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    return Path(shutil.copytree(ready, folder))


def files(folder: Path) -> dict[str, str]:
    """SHA-256 by path, hidden ones too."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in OWN_TIMES
    }


def hidden(folder: Path) -> list[str]:
    return [path.relative_to(folder).as_posix() for path in folder.rglob(".*")]


def cleaned(forks: Forks, folder: Path, *options: str) -> list[dict[str, object]]:
    done = forks.run(folder, "clean", ".", "--json", *options)
    assert done.code == 0, done.error
    return json.loads(done.out)["leftovers"]  # type: ignore[no-any-return]

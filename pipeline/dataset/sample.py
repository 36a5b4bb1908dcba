"""The data set that comes with advpipe: the clean bag of the scenario `sample`, and a report of its attacks.

`make sample` makes it anew. Its map is that of `district`, which no shipped detector has trained on.
"""

from __future__ import annotations

import shutil
from importlib.resources import files
from pathlib import Path

from advpipe.pipeline.bag.locate import CLEAN_NAME
from advpipe.pipeline.bag.recover import DATA_SET
from advpipe.pipeline.core.partial import staged_folder
from advpipe.pipeline.viewer_layouts.files import write_layouts


def shipped_sample() -> Path:
    """The folder: `scenario.yaml`, `clean/` and `report.html`."""
    return Path(str(files("advpipe.sample")))


def shipped_report() -> Path:
    """The page of the report, which holds its pictures."""
    return shipped_sample() / "report.html"


def copy_sample(out: Path, *, overwrite: bool = False) -> Path:
    """Writes the data set, without its report, to a folder, and returns its clean bag.

    Raises UsageError for a folder that exists, unless `overwrite`.
    """
    source = shipped_sample()
    with staged_folder(out, overwrite, DATA_SET) as folder:
        shutil.copyfile(source / "scenario.yaml", folder / "scenario.yaml")
        (folder / CLEAN_NAME).mkdir()
        for file in (source / CLEAN_NAME).iterdir():
            if file.suffix in (".mcap", ".yaml"):
                shutil.copyfile(file, folder / CLEAN_NAME / file.name)
        write_layouts(folder / CLEAN_NAME)
    return out / CLEAN_NAME

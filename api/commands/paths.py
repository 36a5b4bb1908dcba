"""What the commands take for a bag."""

from __future__ import annotations

import os
from pathlib import Path

from advpipe.pipeline.bag.locate import newest_dataset, resolve_bag
from advpipe.pipeline.process.folder import working_path

PathLike = str | os.PathLike[str]
"""A path as text or `Path`, or the result of an earlier command, which stands for the bag that it made."""

DATA_SETS = "datasets"
"""The folder of data sets where none is named."""


def bag_or_newest(bag: PathLike | None) -> Path:
    """The bag that is named: of a data set its clean one; without a name that of the newest data set.

    Raises AdvpipeError where there is none.
    """
    return resolve_bag(newest_dataset(working_path(DATA_SETS)) if bag is None else Path(bag))

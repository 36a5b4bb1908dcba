"""What the commands take for a bag, and where they put what they make of it."""

from __future__ import annotations

import os
from pathlib import Path

from advpipe.pipeline.bag.locate import CLEAN_NAME, newest_dataset, resolve_bag
from advpipe.pipeline.core.errors import OutputExistsError
from advpipe.pipeline.core.remote_path import RemotePath, refuse_remote
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


def default_output(clean: Path, name: str, folder: str = "") -> Path:
    """Where what is made from a bag lies if the user names no output: in the bag's data set, or its `folder`,
    under this name; beside a bag that belongs to no data set, under the bag's name and this one. What is made
    from a bag in an object store lies in the data set of the same name under `datasets`."""
    if clean.name != CLEAN_NAME:
        name = f"{clean.name if clean.is_dir() else clean.stem}-{name}"
    beside = working_path(DATA_SETS) / clean.parent.name if isinstance(clean, RemotePath) else clean.parent
    return beside / folder / name


def output_beside(bag: Path, name: str, out: Path | None = None) -> Path:
    """The output that the user names; without one, what has this name beside a bag, and for a bag in an
    object store under `datasets`. Raises UsageError for one in an object store."""
    if out is not None:
        refuse_remote(out, "name a folder of this machine with --out")
        return out
    return working_path(DATA_SETS) / name if isinstance(bag, RemotePath) else bag.with_name(name)


def refuse_existing(out: Path, overwrite: bool) -> None:
    """Raises OutputExistsError for an output that is there and is not to be overwritten.

    The stages check the same, but after loading their libraries.
    """
    refuse_remote(out, "name a folder of this machine with --out")
    if out.exists() and not overwrite:
        raise OutputExistsError(out)

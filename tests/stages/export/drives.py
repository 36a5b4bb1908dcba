"""Data sets to export: the shipped sample, and what tests make up."""

from __future__ import annotations

import shutil
from pathlib import Path

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.stages.import_.drive import DriveFrame
from advpipe.stages.import_.record import frame_messages

SAMPLE = Path(__file__).parents[3] / "sample" / "clean"


def sample_data_set(folder: Path, *others: str) -> Path:
    """The sample's clean bag, also under the names of attacks."""
    shutil.copytree(SAMPLE, folder / "clean")
    for name in others:
        shutil.copytree(SAMPLE, folder / name)
    return folder


def write_bag(folder: Path, *frames: DriveFrame) -> Path:
    """A bag of frames, without static transforms."""
    with BagWriter(folder, provenance={"kind": "test"}) as writer:
        for frame in frames:
            for message in frame_messages(frame):
                writer.write_cdr(*message)
    return folder

"""The maps of the drives that a detector is trained on, for its checkpoint."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.checkpoint import load_checkpoint
from advpipe.pipeline.detector.training_maps import KEY, listed_maps, map_of


def training_maps(bags: Iterable[Path], start: Path | None) -> str:
    """The value of `training_maps.KEY` in a checkpoint's provenance: a JSON list.

    The maps of the bags and those on which the start checkpoint was trained, each once; null for a
    bag without a map in its provenance, and for a start checkpoint without its own list.
    """
    maps = {map_of(BagReader(bag).provenance) for bag in bags}
    if start is not None:
        known = listed_maps(load_checkpoint(start).provenance.get(KEY))
        maps |= {None} if known is None else set(known)
    named = sorted(each for each in maps if each is not None)
    return json.dumps([*named, *([None] if None in maps else [])])

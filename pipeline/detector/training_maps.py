"""The maps that a detector was trained on: it performs better there than on unseen maps."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Protocol, runtime_checkable

from pydantic import BaseModel, Field, TypeAdapter

from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.hashing import sha256_of

KEY = "maps_sha256"
"""Provenance key of a checkpoint: a JSON list of the unique `map_sha256` of its training drives' bags;
null stands for drives without that record."""

MOST_MAPS = 100_000
LIMIT_BYTES = 1 << 23

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_LIST = TypeAdapter(Annotated[list[Sha256 | None], Field(max_length=MOST_MAPS)])


@runtime_checkable
class ReportsTrainingMaps(Protocol):
    """A detector that reports which maps it was trained on; a user's class may implement it."""

    @property
    def training_maps_sha256(self) -> Sequence[str | None] | None:
        """SHA-256 of each map, equal to `map_sha256` of bags recorded on it; a None in the list stands for
        drives on unknown maps. None instead of a list where nothing is known."""


class MapList(BaseModel, frozen=True):
    """The list of maps in a file beside a checkpoint that does not hold its maps itself.

    made_with: the version of SUMO that generated the networks. maps_sha256: by the drive's name.
    """

    checkpoint_sha256: Sha256
    made_with: str
    maps_sha256: dict[str, Sha256]


def is_training_map(detector: object, map_sha256: str | None) -> bool | None:
    """Whether the detector was trained on drives on this map; None where detector or bag do not record it."""
    known = detector.training_maps_sha256 if isinstance(detector, ReportsTrainingMaps) else None
    if known is None or map_sha256 is None:
        return None
    if map_sha256 in known:
        return True
    return None if None in known else False


def map_of(provenance: Mapping[str, str]) -> str | None:
    """The map of a bag from its provenance; None where it records none."""
    digest = provenance.get("map_sha256", "")
    return digest if re.fullmatch(r"[0-9a-f]{64}", digest) else None


def listed_maps(text: str | None) -> list[str | None] | None:
    """The maps in a checkpoint's provenance; None where the list is missing or invalid."""
    try:
        return None if text is None else _LIST.validate_python(plain_json.load_json(text, LIMIT_BYTES))
    except ValueError:  # a ValidationError is one
        return None


def list_beside(checkpoint: Path) -> Path:
    """The path of the list of a checkpoint's maps, if it does not hold them itself."""
    return checkpoint.with_suffix(".maps.json")


def with_listed_maps(
    provenance: Mapping[str, str], checkpoint: Path, shipped: Iterable[Path]
) -> dict[str, str]:
    """The provenance of a checkpoint, with the listed maps if it is a shipped one or a copy of it."""
    if KEY in provenance:
        return dict(provenance)
    for file in map(list_beside, shipped):
        if file.is_file():
            known = MapList.model_validate(plain_json.load_json(file.read_bytes(), LIMIT_BYTES))
            if sha256_of(checkpoint) == known.checkpoint_sha256:
                maps = sorted(set(known.maps_sha256.values()))
                return {**provenance, KEY: TypeAdapter(list[str]).dump_json(maps).decode()}
    return dict(provenance)

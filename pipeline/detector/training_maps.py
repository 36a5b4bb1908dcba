"""Which maps a detector was trained on: its figures there are better than on a map that it never saw."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Protocol, runtime_checkable

from pydantic import BaseModel, Field, TypeAdapter

from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.detector.protocol import ObjectDetector

KEY = "maps_sha256"
"""Of a checkpoint's provenance: a JSON list of the `map_sha256` of its training drives' bags, each once;
null stands for drives that do not tell theirs."""

MOST_MAPS = 100_000
LIMIT_BYTES = 1 << 23

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_LIST = TypeAdapter(Annotated[list[Sha256 | None], Field(max_length=MOST_MAPS)])


@runtime_checkable
class ReportsTrainingMaps(Protocol):
    """A detector that tells which maps it was trained on; a user's own class may be one."""

    @property
    def training_maps_sha256(self) -> Sequence[str | None] | None:
        """SHA-256 of each map, as bags of drives on it have `map_sha256`; a None among them stands for drives
        on maps that are not known. None instead of a list where nothing is known."""


class MapList(BaseModel, frozen=True):
    """The file beside a checkpoint that was trained before checkpoints held their maps.

    made_with: the version of SUMO that generated the networks. maps_sha256: by the drive's name.
    """

    checkpoint_sha256: Sha256
    made_with: str
    maps_sha256: dict[str, Sha256]


def is_training_map(detector: ObjectDetector, map_sha256: str | None) -> bool | None:
    """Whether the detector was trained on drives on this map; None where detector or bag do not tell."""
    known = detector.training_maps_sha256 if isinstance(detector, ReportsTrainingMaps) else None
    if known is None or map_sha256 is None:
        return None
    if map_sha256 in known:
        return True
    return None if None in known else False


def map_of(provenance: Mapping[str, str]) -> str | None:
    """The map of a bag by its record; None where it names none."""
    told = provenance.get("map_sha256", "")
    return told if re.fullmatch(r"[0-9a-f]{64}", told) else None


def listed_maps(text: str | None) -> list[str | None] | None:
    """The maps in a checkpoint's provenance; None where it lists none, or what is there is no such list."""
    try:
        return None if text is None else _LIST.validate_python(plain_json.load_json(text, LIMIT_BYTES))
    except ValueError:  # a ValidationError is one
        return None


def list_beside(checkpoint: Path) -> Path:
    """Where the list of a checkpoint's maps lies, if it does not hold them itself."""
    return checkpoint.with_suffix(".maps.json")


def with_listed_maps(
    provenance: Mapping[str, str], checkpoint: Path, shipped: Iterable[Path]
) -> dict[str, str]:
    """The provenance of a checkpoint with the maps of a shipped one, if it is that or a copy of it."""
    if KEY in provenance:
        return dict(provenance)
    for file in map(list_beside, shipped):
        if file.is_file():
            known = MapList.model_validate(plain_json.load_json(file.read_bytes(), LIMIT_BYTES))
            if sha256_of(checkpoint) == known.checkpoint_sha256:
                maps = sorted(set(known.maps_sha256.values()))
                return {**provenance, KEY: TypeAdapter(list[str]).dump_json(maps).decode()}
    return dict(provenance)

"""One cell of a grid: what identifies it, what made it, and its figures."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from advpipe.pipeline.campaigns.grid.load import GridDrive
from advpipe.pipeline.campaigns.grid.models import GridFile
from advpipe.pipeline.core.document import Count, Document, Number, ShortText
from advpipe.pipeline.detector.attacked import attacked_name

WHOLE = "all"
"""The stratum of all objects; the others are of a cell without a defence."""

Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class GridOrigin(Document):
    """What made a cell.

    detector_sha256: "" for a class without a source file. commit: of advpipe's sources, None outside a
    checkout.
    """

    advpipe: ShortText
    code_sha256: Sha256
    commit: ShortText | None
    clean_sha256: Sha256
    bag_sha256: Sha256
    detector_sha256: ShortText
    attacked_against: ShortText | None
    is_white_box: bool | None


class GridValues(Document):
    """The figures of a stratum of the objects of a cell; None for one that is undefined or not computed.

    map_clean, map_adv, map_baseline: strict R40, in [0, 1], under the cell's defence. map_ratio_percent: with
    the interval over blocks of the drive. baseline: the random baseline to beat. From position_rmse_clean_m
    on: of a vehicle, under attacks on fixes or messages, see `messages.score_messages`.
    """

    stratum: ShortText
    objects: Count
    frames: Count
    map_clean: Number | None
    map_adv: Number | None
    map_baseline: Number | None = None
    baseline: ShortText | None = None
    map_ratio_percent: Number | None = None
    map_ratio_low_percent: Number | None = None
    map_ratio_high_percent: Number | None = None
    attack_success_percent: Number | None = None
    chamfer_distance_m2: Number | None = None
    points_removed: Count | None = None
    points_added: Count | None = None
    points_moved: Count | None = None
    position_rmse_clean_m: Number | None = None
    position_rmse_adv_m: Number | None = None
    fixes_detected_percent: Number | None = None
    off_course_percent: Number | None = None
    false_messages: Count | None = None
    misbehaviour_f1: Number | None = None
    misbehaviour_recall: Number | None = None
    ldm_error_clean_m: Number | None = None
    ldm_error_adv_m: Number | None = None
    false_ldm_entries: Number | None = None
    honest_delivered_clean_percent: Number | None = None
    honest_delivered_percent: Number | None = None
    false_warnings: Count | None = None


class StoredGridCell(Document):
    """A finished cell as it is stored: identity, origin, and its figures by stratum."""

    identity: dict[ShortText, Any]
    origin: GridOrigin
    values: tuple[GridValues, ...] = Field(min_length=1, max_length=100)

    def to_json(self) -> str:
        """The same text for the same cell."""
        return json.dumps(self.model_dump(mode="json"), indent=1, sort_keys=True, allow_nan=False) + "\n"


@dataclass(frozen=True)
class GridCell:
    """A cell that may not have been run yet; attack and detector as the grid names them.

    detector: "" for attacks that leave clouds as they are.
    """

    drive: GridDrive
    attack: str
    detector: str
    defence: str

    def identity(self, grid: GridFile, sha256_of: Mapping[str, str], device: str) -> dict[str, Any]:
        """All that decides its figures but the code: no name that the user may change, and no path.

        sha256_of: by detector, those that are attacked among them.
        """
        return {
            "drive": self.drive.id,
            "attack": [
                spec.model_dump(mode="json")
                | {"detector": attacked_name(spec.detector), "detector_sha256": sha256_of[spec.detector]}
                for spec in grid.attacks[self.attack]
            ],
            "detector_sha256": sha256_of.get(self.detector, ""),
            "detector": Path(self.detector).name,
            "defence": self.defence,
            "frames": grid.frames,
            "baseline_tries": grid.baseline_tries,
            "lidar": grid.lidar,
            "device": device.partition(":")[0],
        }


def cell_file_name(identity: dict[str, Any]) -> str:
    """The name of a cell's file."""
    text = json.dumps(identity, sort_keys=True)
    return f"{identity['drive']}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.json"


@dataclass(frozen=True)
class ScoredCell:
    """A finished cell of the grid."""

    cell: GridCell
    stored: StoredGridCell

    def rows(self, grid: str) -> list[dict[str, Any]]:
        """A row for each stratum, as the Parquet file has it: names, figures, origin."""
        cell = self.cell
        names = {
            "grid": grid,
            **cell.drive.levels,
            **{"seed": cell.drive.seed, "drive": cell.drive.id, "attack": cell.attack},
            **{"detector": Path(cell.detector).name, "defence": cell.defence},
        }
        origin = self.stored.origin.model_dump()
        return [{**names, **values.model_dump(), **origin} for values in self.stored.values]

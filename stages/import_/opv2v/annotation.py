"""What an agent of OPV2V writes beside a cloud: its pose, and the vehicles around it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from advpipe.pipeline.core.document import Document, Number, ShortText, read_text, read_yaml

Pose = Annotated[list[Number], Field(min_length=6, max_length=6)]
"""x, y, z in metres and roll, yaw, pitch in degrees, in CARLA's left-handed frame."""
Three = Annotated[list[Number], Field(min_length=3, max_length=3)]


class SurroundingVehicle(Document):
    """A vehicle that an agent sees, in CARLA's map.

    location: the origin of the vehicle's frame. center: of its box, from there, along the map's axes. extent:
    half length, width and height. angle: roll, yaw, pitch in degrees. speed: km/h. bp_id: CARLA's blueprint,
    and obj_type: a class, where the file names them.
    """

    location: Three
    center: Three = Field([0.0, 0.0, 0.0])
    extent: Three
    angle: Three
    speed: Number | None = None
    bp_id: ShortText | None = None
    obj_type: ShortText | None = None


def _keys_as_text(vehicles: Any) -> Any:
    """Objects are numbered; a Python dictionary may hold their numbers or texts."""
    if vehicles is None:
        return {}
    return {str(key): value for key, value in vehicles.items()} if isinstance(vehicles, dict) else vehicles


class Annotation(Document):
    """The file of one agent at one instant; vehicles: by their number."""

    lidar_pose: Pose
    true_ego_pos: Pose | None = None
    vehicles: Annotated[dict[ShortText, SurroundingVehicle], BeforeValidator(_keys_as_text)] = Field({})


def read_annotation(file: Path) -> Annotation:
    """Read an agent's file. Raises AdvpipeError, one line, for one that is not of OPV2V."""
    annotation: Annotation = read_yaml(
        read_text(file), Annotation, str(file), "is this a file of OPV2V (OpenCDA)?"
    )
    return annotation

"""How road users look: their paint, clothes, lamps and number plates."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.pipeline.sensors.camera.surfaces import HEAD_LAMP, NO_LAMP, TAIL_LAMP
from advpipe.pipeline.v2x.codec.codes import StationType
from advpipe.stages.simulate.bodies import Body
from advpipe.stages.simulate.traffic.road_users import RoadUser
from advpipe.stages.simulate.world.raycast.materials import COLOUR, MATERIAL_ID, SEMANTIC, SEMANTIC_CLASSES
from advpipe.stages.simulate.world.raycast.mesh import Mesh

Float32 = npt.NDArray[np.float32]
UInt8 = npt.NDArray[np.uint8]

SHIRTS = np.array(
    [[0.55, 0.05, 0.05], [0.04, 0.1, 0.35], [0.6, 0.6, 0.58], [0.05, 0.05, 0.06], [0.08, 0.25, 0.12],
     [0.6, 0.42, 0.06], [0.3, 0.32, 0.35], [0.2, 0.4, 0.55], [0.4, 0.12, 0.3], [0.7, 0.3, 0.1]],
    np.float32,
)  # fmt: skip
TROUSERS = np.array(
    [[0.03, 0.05, 0.12], [0.03, 0.03, 0.035], [0.18, 0.16, 0.12], [0.1, 0.11, 0.13], [0.25, 0.22, 0.18]],
    np.float32,
)
HAIR = np.array([[0.02, 0.015, 0.01], [0.08, 0.04, 0.02], [0.25, 0.17, 0.07], [0.3, 0.3, 0.3]], np.float32)
TARPAULINS = np.array(
    [[0.75, 0.75, 0.75], [0.04, 0.12, 0.4], [0.5, 0.05, 0.04], [0.1, 0.3, 0.15], [0.5, 0.5, 0.5]], np.float32
)
TAIL_GLASS = np.array([0.35, 0.01, 0.01], np.float32)

_PERSON = SEMANTIC_CLASSES.index("person")
_IS_CLOTH = np.array([name in ("cloth", "cloth_dark") for name in MATERIAL_ID])


def body_tag(body: Body) -> int:
    """CARLA's semantic tag of a body."""
    if body.label == "truck":
        return TAG["Bus"] if body.station_type == StationType.BUS else TAG["Truck"]
    if body.label == "cyclist":
        return TAG["Bicycle"] if body.station_type is None else TAG["Motorcycle"]
    return TAG["Car"] if body.label == "car" else TAG["Pedestrian"]


@dataclass(frozen=True)
class UserTraits:
    """What the looks of U road users depend on. numbers: (U,) int64, drawn by their ids. height_m: (U,).
    is_on_foot: (U,) bool, whether their clothes are seen. tags: (U,) uint8, CARLA's."""

    numbers: npt.NDArray[np.int64]
    height_m: Float32
    is_on_foot: npt.NDArray[np.bool_]
    tags: UInt8

    @classmethod
    def of(cls, users: Sequence[RoadUser]) -> UserTraits:
        bodies = [user.variant.body for user in users]
        return cls(
            np.array([zlib.crc32(user.id.encode()) for user in users], np.int64),
            np.array([user.variant.height_m for user in users], np.float32),
            np.array([body.label in ("pedestrian", "cyclist") for body in bodies], np.bool_),
            np.array([body_tag(body) for body in bodies], np.uint8),
        )


class BodyLook:
    """The colours of all variants' meshes, stacked in the order of `InstancedBodies`."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        self._materials = np.append(np.concatenate([mesh.materials for mesh in meshes]), np.uint8(0))

    def materials(self, triangles: npt.NDArray[np.int32]) -> UInt8:
        """The materials (N,) of triangles (N,)."""
        found: UInt8 = np.take(self._materials, triangles)
        return found

    def colours(
        self, materials: UInt8, traits: UserTraits, user_of: npt.NDArray[np.int64], local_m: Float32
    ) -> tuple[Float32, UInt8]:
        """Colours (N, 3) and lamps (N,) at points (3, N) in the frames of their road users (N,)."""
        numbers = np.take(traits.numbers, user_of)
        is_on_foot = np.take(traits.is_on_foot, user_of)
        colours = np.take(COLOUR, materials, axis=0)
        light = np.float32(0.9) + (traits.numbers % 17).astype(np.float32) * np.float32(0.012)
        colours *= np.take(light, user_of)[:, None]
        lamps = np.full(len(materials), NO_LAMP, np.uint8)
        lamp = np.flatnonzero(materials == MATERIAL_ID["lamp"])
        rear = local_m[0, lamp] < 0
        lamps[lamp] = np.where(rear, TAIL_LAMP, HEAD_LAMP)
        colours[lamp[rear]] = TAIL_GLASS
        share = local_m[2] / np.take(traits.height_m, user_of)
        clothes = np.flatnonzero(_IS_CLOTH[materials] & is_on_foot)
        upper = share[clothes] > 0.5
        colours[clothes[upper]] = SHIRTS[numbers[clothes[upper]] % len(SHIRTS)]
        colours[clothes[~upper]] = TROUSERS[numbers[clothes[~upper]] // 16 % len(TROUSERS)]
        hair = np.flatnonzero((materials == MATERIAL_ID["skin"]) & is_on_foot & (share > 0.955))
        colours[hair] = HAIR[numbers[hair] // 128 % len(HAIR)]
        sheet = np.flatnonzero(materials == MATERIAL_ID["tarpaulin"])
        colours[sheet] = TARPAULINS[numbers[sheet] // 8 % len(TARPAULINS)]
        _letter(colours, np.flatnonzero(materials == MATERIAL_ID["plate"]), numbers, local_m[1])
        return colours, lamps


def _letter(
    colours: Float32, plate: npt.NDArray[np.int64], numbers: npt.NDArray[np.int64], y_m: Float32
) -> None:
    """Draw the characters and the blue band of number plates, as seen from outside."""
    place = y_m[plate]
    strokes = (numbers[plate] >> ((place + 0.3) * 55).astype(np.int64) % 24) & 1
    colours[plate[(strokes == 1) & (np.abs(place) < 0.19)]] = np.float32(0.05)
    colours[plate[np.abs(place) > 0.225]] = (0.03, 0.1, 0.5)


def body_tags(materials: UInt8, traits: UserTraits, user_of: npt.NDArray[np.int64]) -> UInt8:
    """CARLA's semantic tags (N,): a person on two wheels is a rider; people in cars belong to the car."""
    tags = np.take(traits.tags, user_of)
    is_two_wheeled = (tags == TAG["Bicycle"]) | (tags == TAG["Motorcycle"])
    tags[is_two_wheeled & (SEMANTIC[materials] == _PERSON)] = TAG["Rider"]
    return tags

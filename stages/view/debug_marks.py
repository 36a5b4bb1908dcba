"""What the debug topics of an adversarial bag say: touched points, and positions that are true and false."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.messages.cloud import Cloud, xyz
from advpipe.pipeline.messages.cloud_difference import CloudDifference
from advpipe.pipeline.messages.debug import (
    BELIEVED,
    FALSE,
    LIFETIME_S,
    NOT_SENT,
    TOUCHED_COLOURS_RGB,
    TOUCHED_POINT_DTYPE,
    TRUE,
    MarkedPosition,
    is_debug,
    marked_positions,
    touched_points_topic,
)
from advpipe.pipeline.viewer.scene import (
    BELIEVED_POSITION,
    CLAIM,
    CLAIM_LINE,
    CLAIMED,
    TRUE_POSITION,
    WITHHELD,
    Fact,
    SceneBox,
    SceneLine,
)

_OUTCOMES = {TRUE: TRUE_POSITION, FALSE: CLAIMED, BELIEVED: BELIEVED_POSITION, NOT_SENT: WITHHELD}
_SIDE_M = 1.2
_MARKERS = "visualization_msgs/msg/MarkerArray"


@dataclass(frozen=True)
class TouchedCloud:
    """An adversarial cloud, and the clean one as far as the bag alone tells it: moved points stand where the
    attack put them."""

    clean: Cloud
    attacked: Cloud
    change: CloudDifference


def touched_cloud(bag: BagReader, lidar_topic: str, time_ns: int, cloud: Cloud) -> TouchedCloud | None:
    """An adversarial cloud with what its debug topic says; None without such a message.

    bag: a reader with debug topics.
    """
    points = _touched_points(bag, lidar_topic, time_ns)
    if points is None:
        return None
    removed, moved, added = (points[points["action"] == code] for code in _codes())
    removed_cloud = np.zeros(len(removed), cloud.dtype)
    for axis in "xyz":
        removed_cloud[axis] = removed[axis]
    is_added = np.zeros(len(cloud), bool)
    is_added[len(cloud) - min(len(cloud), len(added)) :] = True  # added points come last
    is_moved = ~is_added & np.isin(_rows(xyz(cloud)), _rows(xyz(moved)))
    # In both clouds, a point that was not added has the same index.
    kept = cloud[~is_added]
    count, none = len(kept), np.zeros(0, np.int64)
    change = CloudDifference(
        removed=np.arange(count, count + len(removed)),
        added=np.flatnonzero(is_added),
        moved=np.flatnonzero(is_moved[~is_added]),
        displacement_m=np.zeros(int(is_moved.sum())),
        intensity_changed=none,
    )
    return TouchedCloud(np.concatenate([kept, removed_cloud]), cloud, change)


def claims(
    bag: BagReader, time_ns: int, lidar_SE3_map: Float64, condition: str
) -> tuple[list[SceneBox], list[SceneLine]]:
    """The positions that debug topics show at an instant, as boxes and lines from the true positions."""
    boxes, lines = list[SceneBox](), list[SceneLine]()
    for positions in _marked(bag, time_ns):
        places = {one.role: transform_points(lidar_SE3_map, one.position_m[None])[0] for one in positions}
        label = next((one.label for one in positions if one.label), "").rpartition(": ")[0]
        for one in positions:
            boxes.append(_box(one, places, label, condition))
            if TRUE in places and one.role != TRUE:
                ends = np.stack([places[TRUE], places[one.role]])
                lines.append(SceneLine(CLAIM_LINE, ends, condition))
    return boxes, lines


def _box(one: MarkedPosition, places: dict[str, Float64], label: str, condition: str) -> SceneBox:
    outcome = _OUTCOMES[one.role]
    facts = [Fact("attack", label)] if label else []
    if one.role != TRUE and TRUE in places:
        offset_m = float(np.linalg.norm(places[one.role] - places[TRUE]))
        facts.append(Fact("from the true position", f"{offset_m:.1f} m"))
    return SceneBox(
        CLAIM,
        [*places[one.role].tolist(), _SIDE_M, _SIDE_M, _SIDE_M, 0.0],
        f"station {one.id}" if one.id else label or "GPS",
        outcome,
        condition,
        f"claim {one.role} {one.id}",
        group="marks of debug topics",
        facts=tuple(facts),
    )


def _marked(bag: BagReader, time_ns: int) -> Iterator[list[MarkedPosition]]:
    """The newest positions of each claim within the lifetime of its markers."""
    for name in bag.topics_of_type(_MARKERS):
        if not is_debug(name):
            continue
        newest: dict[int, list[MarkedPosition]] = {}
        for raw in bag.raw_messages([name], max(0, time_ns - round(LIFETIME_S * 1e9)), time_ns):
            shown: dict[int, list[MarkedPosition]] = {}
            for one in marked_positions(bag.decode(raw)):
                shown.setdefault(one.id, []).append(one)
            newest |= shown
        yield from newest.values()


def _touched_points(bag: BagReader, lidar_topic: str, time_ns: int) -> npt.NDArray[np.void] | None:
    topic = touched_points_topic(lidar_topic)
    if topic.name not in bag.topics or bag.topics[topic.name].type != topic.type:
        return None
    for raw in bag.raw_messages([topic.name], time_ns, time_ns):
        message = bag.decode(raw)
        data, size = bytes(message.data), TOUCHED_POINT_DTYPE.itemsize
        names = [field.name for field in message.fields]
        if names == list(TOUCHED_POINT_DTYPE.names or ()) and message.point_step == size:
            return np.frombuffer(data[: len(data) // size * size], TOUCHED_POINT_DTYPE)
    return None


def _codes() -> range:
    return range(1, len(TOUCHED_COLOURS_RGB) + 1)


def _rows(places: npt.NDArray[np.float32]) -> npt.NDArray[np.void]:
    """Each place (K, 3) as one value that can be compared."""
    return np.ascontiguousarray(places).view(np.dtype((np.void, 12))).ravel()

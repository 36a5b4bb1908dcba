"""Whether the debug topics show viewers what the labels state."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels import fixes, messages
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.clouds import FRAMES, POINTS, read_point_labels
from advpipe.pipeline.labels.touched_points import touched_by
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.debug import (
    BELIEVED,
    FALSE,
    MOST_CLAIMS,
    MOST_ID,
    NOT_SENT,
    TRUE,
    MarkedPosition,
    is_debug,
    marked_positions,
    positions_topic,
    touched_points_cdr,
    touched_points_topic,
)
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.pipeline.replay.recorded_filter import read_filter
from advpipe.stages.verify.checks.attacked import AttackedBag
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.checks.points import label_differences
from advpipe.stages.verify.result import Fault, Result

TOLERANCE_M = 1e-3
"""Of positions that are projected again."""

_ROLES = (TRUE, FALSE, NOT_SENT)
_CLAIM = np.dtype([("time_ns", "i8"), ("id", "i8"), ("role", "i1"), ("x_m", "f8"), ("y_m", "f8")])
_COLUMNS = (
    *("time_ns", "sent_ns", "action"),
    *(f"{state}_{name}" for state in (TRUE, FALSE) for name in ("station_id", "x_m", "y_m")),
)


class DebugTopics(BagCheck):
    """Compares each debug topic with the labels and the two bags; a bag without debug topics is in order."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        reader = BagReader(self.bag.path, debug=True)
        shown = {name for name in reader.topics if is_debug(name)}
        if not shown:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        clouds = {touched_points_topic(name).name for name in attacked.cloud_topics}
        sent = positions_topic(V2X_SENT.name).name
        vehicles = {name.split("/")[3] for name in shown if name.endswith("/gnss/fix")}
        spoofed = {positions_topic(VehicleTopics(name).gnss_fix.name).name: name for name in sorted(vehicles)}
        if shown & clouds:
            yield from self._points(attacked, reader)
        if sent in shown:
            yield from self._messages(attacked, reader, sent)
        for topic, vehicle in spoofed.items():
            yield from self._fixes(attacked, reader, topic, vehicle)
        for name in sorted(shown - clouds - {sent} - spoofed.keys()):
            yield Fault(f"{self.bag.place} {name}", "is a debug topic of nothing that was attacked")

    def _points(self, attacked: AttackedBag, reader: BagReader) -> Iterator[Result]:
        topics = attacked.cloud_topics
        after = reader.raw_messages(topics)
        shown = reader.raw_messages([touched_points_topic(name).name for name in topics])
        before = attacked.clean.raw_messages(topics)
        labels = read_point_labels(attacked.table(POINTS))
        label, seen = next(labels, None), next(shown, None)
        for row, raw in zip(rows(attacked.table(FRAMES), ["topic", "frame"]), after, strict=False):
            topic = touched_points_topic(raw.topic.name).name
            if label is None or (label.topic, label.frame) != (row["topic"], row["frame"]):
                continue
            clean = next((each for each in before if _key(each) == _key(raw)), None)
            if clean is None:
                return  # the check of points tells
            old, new = attacked.clean.cloud(clean), reader.cloud(raw)
            change = CloudChange(old.cloud, new.cloud, label.labels)
            label = next(labels, None)
            is_shown = seen is not None and _key(seen) == (raw.log_time_ns, topic)
            cdr = seen.cdr if seen is not None and is_shown else b""
            seen = next(shown, None) if is_shown else seen
            if any(label_differences(change)):
                continue  # the same
            if cdr != touched_points_cdr(touched_by(change), old.stamp_ns, old.frame_id):
                what = "other points than those that the attack touched" if is_shown else "no touched points"
                yield Fault(f"{self.bag.place} {topic}", f"shows {what} in frame {row['frame']}")
        if seen is not None:
            yield Fault(
                f"{self.bag.place} {seen.topic.name}",
                f"shows touched points at {seen.log_time_ns} ns, where no cloud has labels",
            )

    def _messages(self, attacked: AttackedBag, reader: BagReader, topic: str) -> Iterator[Result]:
        where, path = f"{self.bag.place} {topic}", attacked.table(messages.FILE)
        claims = np.fromiter(_claims(path), _CLAIM) if path.is_file() else np.zeros(0, _CLAIM)
        steps_ns = attacked.clean.log_times_ns(V2X_STATIONS.name)
        claims = claims[np.argsort(claims["time_ns"], kind="stable")]
        step_of = np.searchsorted(steps_ns, claims["time_ns"], side="right")
        unseen = set(step_of.tolist())
        for time_ns, message in reader.messages(topic):
            step = int(np.searchsorted(steps_ns, time_ns, side="right"))
            unseen.discard(step)
            part = claims[slice(*np.searchsorted(step_of, [step, step + 1]))]
            shown = marked_positions(message)
            ids = {each.id for each in shown}
            if not len(part) or part["time_ns"][-1] != time_ns:
                yield Fault(where, f"has a message at {time_ns} ns, which is not the last time of a step")
            elif not all(_is_claimed(each, part) for each in shown):
                yield Fault(where, f"shows positions at {time_ns} ns that no label states")
            elif len(ids) < MOST_CLAIMS and not set(part["id"].tolist()) <= ids:
                yield Fault(where, f"shows fewer positions at {time_ns} ns than the labels state")
        if unseen:
            yield Fault(where, f"shows nothing in {len(unseen)} steps with labels")

    def _fixes(self, attacked: AttackedBag, reader: BagReader, topic: str, vehicle: str) -> Iterator[Result]:
        where, path = f"{self.bag.place} {topic}", attacked.table(fixes.FILE)
        stated = rows(path) if path.is_file() else iter(())
        labels = (row for row in stated if row["vehicle"] == vehicle and row["attack"] is not None)
        geodesy, odometry = read_filter(attacked.clean).geodesy, VehicleTopics(vehicle).odometry.name
        estimates = reader.messages(odometry) if odometry in reader.topics else iter(())
        estimate = next(estimates, None)
        for time_ns, message in reader.messages(topic):
            row = next(labels, None)
            if row is None:
                yield Fault(where, f"shows a fix at {time_ns} ns that no label states as attacked")
                return
            while estimate is not None and estimate[0] < time_ns:
                estimate = next(estimates, None)
            expected = {} if estimate is None else {BELIEVED: _position(estimate[1])}
            for role in (TRUE, FALSE):
                if row[f"{role}_{fixes.GEOGRAPHIC[0]}"] is not None:
                    geographic = np.array([row[f"{role}_{name}"] for name in fixes.GEOGRAPHIC])
                    expected[role] = geodesy.to_map(geographic)
            shown = {each.role: each.position_m for each in marked_positions(message)}
            if shown.keys() != expected.keys() or any(
                not np.allclose(shown[role], expected[role], rtol=0, atol=TOLERANCE_M) for role in expected
            ):
                yield Fault(where, f"shows other positions at {time_ns} ns than labels and odometry state")
        if next(labels, None) is not None:
            yield Fault(where, "shows fewer fixes than the labels state as attacked")


def _key(raw: RawMessage) -> tuple[int, str]:
    return raw.log_time_ns, raw.topic.name


def _claims(path: Path) -> Iterator[tuple[int, int, int, float, float]]:
    """What the labels let a debug topic show: time, station id, role, and place in the map."""
    for row in rows(path, _COLUMNS):
        is_sent = row["sent_ns"] is not None
        claims = [(row["sent_ns"], role, role) for role in (TRUE, FALSE) if is_sent]
        if row["action"] in (messages.DROPPED, messages.DELAYED):
            claims.append((row["time_ns"], NOT_SENT, FALSE if is_sent else TRUE))
        ids = (row["false_station_id"], row["true_station_id"])
        station_id = ids[1] if ids[0] is None else ids[0]
        for time_ns, role, state in claims:
            x_m, y_m = row[f"{state}_x_m"], row[f"{state}_y_m"]
            if None not in (x_m, y_m, station_id):
                yield time_ns, station_id % MOST_ID, _ROLES.index(role), x_m, y_m


def _is_claimed(shown: MarkedPosition, claims: npt.NDArray[np.void]) -> bool:
    same = claims[(claims["id"] == shown.id) & (claims["role"] == _ROLES.index(shown.role))]
    offset_m = np.stack([same["x_m"], same["y_m"]], axis=1) - shown.position_m[:2]
    return bool((np.abs(offset_m) <= TOLERANCE_M).all(axis=1).any())


def _position(odometry: Any) -> Float64:
    at = odometry.pose.pose.position
    return np.array([at.x, at.y, at.z])

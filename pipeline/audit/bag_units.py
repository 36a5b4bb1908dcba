"""The units of one bag, measured: each bag is read by itself."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from advpipe.pipeline.audit.chunk_probes import CHUNK_PROBES, ChunkView
from advpipe.pipeline.audit.fix_probes import FIX_PROBES, FixView
from advpipe.pipeline.audit.image_probes import IMAGE_PROBES, ImageFile, ImageView
from advpipe.pipeline.audit.lidar_probes import CLOUD_PROBES, POINT_PROBES
from advpipe.pipeline.audit.lidar_view import CloudView, LidarHabits
from advpipe.pipeline.audit.message_probes import CPM_PROBES, MESSAGE_PROBES, STATION_PROBES
from advpipe.pipeline.audit.message_view import MessageView, StationView
from advpipe.pipeline.audit.probe import Unit
from advpipe.pipeline.audit.roc_area import Bool
from advpipe.pipeline.audit.scan_probes import RETURN_PROBES, SCAN_PROBES, ScanView
from advpipe.pipeline.audit.touched import TouchedUnits, touched_clouds, touched_points
from advpipe.pipeline.audit.units import Units, joined_units, measured
from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import receiving_vehicles, recorded_receptions
from advpipe.pipeline.bag.recorded_cameras import cameras_of
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.frame_slice import ALL_FRAMES, FrameSlice
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.labels.clouds import FRAMES
from advpipe.pipeline.labels.points import ADDED, REMOVED, PointLabels
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.compressed_image import image_from_cdr
from advpipe.pipeline.messages.radar import SCAN_TYPE, scan_from_cdr
from advpipe.pipeline.v2x.message_type import CAM, CPM, MessageType

MOST_POINTS = 2000
"""Touched and untouched points, each, that are drawn from one cloud."""

CLUSTER_NS = 1_000_000_000
"""Units of one second count as one cluster of a drive; messages of one station do."""

HABIT_CLOUDS = 2
"""Clouds of a bag from which the sensor's rays, order and grid are learnt."""

_FIX_TYPE = "sensor_msgs/msg/NavSatFix"


def bag_units(path: Path, most_clouds: int) -> dict[Unit, Units]:
    """Every unit of a bag, by kind; of LiDAR clouds and radar scans, at most so many of a topic, evenly
    spread. Raises AdvpipeError for a damaged bag."""
    reader, touched = BagReader(path), TouchedUnits.read(path)
    parts: dict[Unit, list[Units]] = {}
    for units in _parts(reader, touched, most_clouds):
        if len(units):
            parts.setdefault(units.unit, []).append(units)
    return {unit: joined_units(own) for unit, own in parts.items()}


def _parts(reader: BagReader, touched: TouchedUnits, most: int) -> Iterator[Units]:
    for topic in lidar_topics(reader):
        yield from _clouds(reader, topic, most)
    for vehicle in receiving_vehicles(reader):
        yield from _messages(reader, vehicle, touched)
    for topic in reader.topics_of_type(_FIX_TYPE):
        yield from _fixes(reader, topic, touched)
    for topic in reader.topics_of_type(SCAN_TYPE):
        yield from _scans(reader, topic, touched, most)
    for camera in cameras_of(reader):
        yield from _images(reader, camera.image_topic, touched)
    if FrameSlice.parse(reader.provenance.fields.frames or "::") != ALL_FRAMES:
        return  # who leaves frames out has other chunks
    chunks = ChunkView.of(mcap_files(reader.path))
    starts_ns = chunks.each("message_start_time").astype(np.int64)
    is_attacked = np.full(len(starts_ns), reader.provenance.is_attack)
    yield measured("chunk", CHUNK_PROBES, chunks, starts_ns // CLUSTER_NS, is_attacked)


def _every(count: int, most: int) -> int:
    return max(1, -(-count // most))


def _each(reader: BagReader, topic: str, every: int) -> Iterator[tuple[int, RawMessage]]:
    """Every such message of a topic with its number; chunks in between are not unpacked."""
    times_ns = reader.log_times_ns(topic)
    for number in range(0, len(times_ns), every):
        time_ns = int(times_ns[number])
        for raw in islice(reader.raw_messages([topic], time_ns, time_ns), 1):
            yield number, raw


def _clouds(reader: BagReader, topic: str, most: int) -> Iterator[Units]:
    every = _every(reader.topics[topic].count, most)
    first = [reader.cloud(raw).cloud for raw in islice(reader.raw_messages([topic]), HABIT_CLOUDS)]
    habits = LidarHabits.seen_in(first)
    times_ns = reader.log_times_ns(topic)
    labelled = islice(touched_clouds(reader.path, topic), 0, None, every)
    for number, raw in _each(reader, topic, every):
        stamp_ns, labels = next(labelled, (None, None))
        scan = reader.cloud(raw)
        previous_ns = int(times_ns[number - 1]) if number else None
        view = CloudView(scan.cloud, habits, len(raw.cdr), scan.stamp_ns, raw.log_time_ns, previous_ns)
        if labels is not None and stamp_ns != scan.stamp_ns:
            raise AdvpipeError(f"{reader.path}: {FRAMES} does not describe the clouds of {topic}")
        cluster = np.array([raw.log_time_ns // CLUSTER_NS])
        yield measured("cloud", CLOUD_PROBES, view, cluster, np.array([labels is not None]))
        if labels is not None and len(scan.cloud):
            yield _points(view, labels, number)


def _points(view: CloudView, labels: PointLabels, number: int) -> Units:
    here = len(view.cloud)
    removed, added = (int((labels.action == action).sum()) for action in (REMOVED, ADDED))
    is_attacked: Bool = np.zeros(here, bool)
    is_attacked[touched_points(labels, here - added + removed, here)] = True
    rng = named_generator(0, "audit", "points", number)
    chosen = np.zeros(here, bool)
    for which in (is_attacked, ~is_attacked):
        chosen[rng.permutation(np.flatnonzero(which))[:MOST_POINTS]] = True
    cluster = np.full(here, view.log_time_ns // CLUSTER_NS)
    return measured("point", POINT_PROBES, view, cluster, is_attacked)[chosen]


def _messages(reader: BagReader, vehicle: str, touched: TouchedUnits) -> Iterator[Units]:
    """Of each type apart: what is usual of one would tell it from the others, not false from true."""
    cams, is_attacked = _received(reader, vehicle, CAM, touched)
    if cams.receptions:
        yield measured("message", MESSAGE_PROBES, cams, cams.station, is_attacked)
        ids = np.array([cams.station[own[0]] for own in cams.of_station])
        is_false = np.array([bool(is_attacked[own].any()) for own in cams.of_station])
        yield measured("station", STATION_PROBES, StationView(cams), ids, is_false)
    cpms, is_attacked = _received(reader, vehicle, CPM, touched)
    if cpms.receptions:
        yield measured("cpm", CPM_PROBES, cpms, cpms.station, is_attacked)


def _received(
    reader: BagReader, vehicle: str, kind: MessageType, touched: TouchedUnits
) -> tuple[MessageView, Bool]:
    receptions = recorded_receptions(reader, vehicle, kind=kind)
    return MessageView(receptions), np.array([each.number in touched.messages for each in receptions], bool)


def _fixes(reader: BagReader, topic: str, touched: TouchedUnits) -> Iterator[Units]:
    """Fixes with a position of their own: to have none, or the last one again, is the attack itself."""
    found: list[tuple[int, Any]] = []
    last = (np.nan, np.nan)
    for raw in reader.raw_messages([topic]):
        message = reader.decode(raw)
        here = (message.latitude, message.longitude)
        if message.status.status >= 0 and np.isfinite(here).all() and here != last:
            found.append((raw.log_time_ns, message))
        last = here
    log_ns = np.array([time_ns for time_ns, _ in found], np.int64)
    stamps_ns = np.array([build.stamp_ns(message) for _, message in found], np.int64)
    vehicle = topic.strip("/").split("/")[0]
    is_attacked = np.array([(vehicle, stamp_ns) in touched.fixes for stamp_ns in stamps_ns.tolist()], bool)
    view = FixView([message for _, message in found], stamps_ns, log_ns)
    if found:
        yield measured("fix", FIX_PROBES, view, log_ns // CLUSTER_NS, is_attacked)


def _scans(reader: BagReader, topic: str, touched: TouchedUnits, most: int) -> Iterator[Units]:
    every = _every(reader.topics[topic].count, most)
    for _, raw in _each(reader, topic, every):
        view = ScanView(scan_from_cdr(raw.cdr), raw.log_time_ns)
        own = touched.returns.get((topic, view.scan.stamp_ns))
        cluster = raw.log_time_ns // CLUSTER_NS
        yield measured("scan", SCAN_PROBES, view, np.array([cluster]), np.array([own is not None]))
        if own is not None and len(view.scan.returns):
            is_attacked = np.isin(np.arange(len(view.scan.returns)), own)
            here = np.full(len(is_attacked), cluster)
            yield measured("return", RETURN_PROBES, view, here, is_attacked)


def _images(reader: BagReader, topic: str, touched: TouchedUnits) -> Iterator[Units]:
    files = [ImageFile.of(image_from_cdr(raw.cdr), raw.log_time_ns) for raw in reader.raw_messages([topic])]
    if not files:
        return
    is_attacked = np.array([(topic, file.stamp_ns) in touched.images for file in files], bool)
    view = ImageView(files)
    yield measured("image", IMAGE_PROBES, view, view.log_time_ns // CLUSTER_NS, is_attacked)

"""What the vehicle knew at an instant: its observations decoded, its place, its map and who is around."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from advpipe.pipeline.bag.lidar_mount import base_link_SE3_lidar
from advpipe.pipeline.bag.localisation import read_initial_pose
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.transforms import Float64, yaw_of
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.measurements import InitialPose
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle, claims_of_cams
from advpipe.pipeline.misbehaviour.pseudonym_links import PseudonymLinks
from advpipe.pipeline.misbehaviour.roads import NO_ROADS, RoadMap
from advpipe.pipeline.replay.roads import roads_of_bag
from advpipe.pipeline.v2x.codec.btp import parse_btp_packet
from advpipe.pipeline.v2x.codec.cam_error import CamError, MessageError
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.facilities.cpm_tree import decode_cpm
from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject, heard_objects
from advpipe.pipeline.v2x.message_type import CAM, CPM, claimed_station_id, message_type_at
from advpipe.stages.investigate.evidence_topics import EvidenceKind, EvidenceTopics
from advpipe.stages.investigate.judged_scan import JudgedScan, LearntSensor
from advpipe.stages.investigate.map_anchor import anchored_geodesy
from advpipe.stages.investigate.observations import (
    LidarScan,
    Observations,
    ObservedPacket,
    ObservedPose,
    read_observations,
)

FRESH_S = 1.2
"""A station's last CAM tells where it is for so long: CAMs come at 1 Hz at least."""

USUAL_SIZE_M = (4.5, 1.8)
_NO_STATION = -1


class HeardClaim(NamedTuple):
    """What a CAM claims. station_id: as its header claims it; power_dbm: NaN where it is not recorded."""

    station_id: int
    claim: Claim
    power_dbm: float


@dataclass(frozen=True)
class Situation:
    """One period of `observed`, decoded.

    pose: the newest estimate of the vehicle's own pose; earlier: the one of the period before. claims: of the
    CAMs that arrived, in that order. heard: the objects in the CPMs that arrived. around: the newest claim of
    each station, `FRESH_S` old at most. geodesy: None while no place on the Earth is known.
    """

    time_ns: int
    observed: Observations
    pose: ObservedPose | None
    claims: tuple[HeardClaim, ...] = ()
    heard: tuple[HeardObject, ...] = ()
    around: Mapping[int, Claim] = field(default_factory=dict)
    scans: tuple[JudgedScan, ...] = ()
    geodesy: Geodesy | None = None
    earlier: ObservedPose | None = None

    def map_SE3_base(self, time_ns: int) -> Float64 | None:
        """The estimate at a time: between the last two, where it lies between them; None without any."""
        if (
            self.pose is None
            or self.earlier is None
            or not self.earlier.time_ns < time_ns < self.pose.time_ns
        ):
            return None if self.pose is None else self.pose.map_SE3_base
        share = (time_ns - self.earlier.time_ns) / (self.pose.time_ns - self.earlier.time_ns)
        nearer = self.pose if share >= 0.5 else self.earlier
        found: Float64 = nearer.map_SE3_base.copy()
        found[:3, 3] = (1 - share) * self.earlier.map_SE3_base[:3, 3] + share * self.pose.map_SE3_base[:3, 3]
        return found

    @property
    def receiver(self) -> ReceivingVehicle:
        """The vehicle itself; without a pose it is nowhere, and what depends on that is not judged."""
        if self.pose is None:
            return ReceivingVehicle(_NO_STATION, np.nan, np.nan, np.nan, *USUAL_SIZE_M)
        x_m, y_m = self.pose.map_SE3_base[:2, 3].tolist()
        return ReceivingVehicle(_NO_STATION, x_m, y_m, yaw_of(self.pose.map_SE3_base), *USUAL_SIZE_M)


@dataclass(frozen=True)
class PriorKnowledge:
    """What the vehicle knew before it set out. initial: None where the bag does not say where it started.
    silence_s: how long stations fall silent at most before they change their pseudonym; None where they keep
    their ids."""

    geodesy: Geodesy | None
    roads: RoadMap
    initial: InitialPose | None
    silence_s: float | None = None

    @classmethod
    def of(cls, reader: BagReader, topics: EvidenceTopics, silence_s: float | None = None) -> PriorKnowledge:
        """That of a bag. Raises AdvpipeError for damaged topics."""
        has_lanes = topics.has(EvidenceKind.LANES)
        has_initial = topics.has(EvidenceKind.INITIAL_POSE)
        return cls(
            anchored_geodesy(reader, topics),
            (roads_of_bag(reader) if has_lanes else None) or NO_ROADS,
            read_initial_pose(reader, VehicleTopics(topics.vehicle)) if has_initial else None,
            silence_s,
        )


def read_situations(reader: BagReader, topics: EvidenceTopics, known: PriorKnowledge) -> Iterator[Situation]:
    """Yield the situations of a bag in time order; one at a time is in memory."""
    decoder = _Decoder(known)
    pose: ObservedPose | None = None
    lidars = _Lidars(reader)
    for observed in read_observations(reader, topics):
        earlier, pose = pose, observed.poses[-1] if observed.poses else pose
        claims, heard = decoder.decoded(observed.packets)
        yield Situation(
            observed.time_ns,
            observed,
            pose,
            tuple(claims),
            tuple(heard),
            decoder.around(observed.time_ns),
            tuple(lidars.judged(scan) for scan in observed.scans),
            decoder.geodesy,
            earlier,
        )


class _Lidars:
    """The LiDARs of the vehicle: how they are mounted, and their rays."""

    def __init__(self, reader: BagReader) -> None:
        self._reader = reader
        self._mounts: dict[str, Float64 | None] = {}
        self._learnt: dict[str, LearntSensor] = {}

    def judged(self, scan: LidarScan) -> JudgedScan:
        frame = scan.scan.frame_id
        if scan.topic not in self._mounts:
            self._mounts[scan.topic] = base_link_SE3_lidar(self._reader, frame)
            self._learnt[scan.topic] = LearntSensor()
        known = self._learnt[scan.topic].known(scan.scan.cloud)
        return JudgedScan(scan.topic, scan, self._mounts[scan.topic], known)


class _Decoder:
    """Decodes received packets, and remembers the newest claim of each station."""

    def __init__(self, known: PriorKnowledge) -> None:
        self.geodesy, self._roads = known.geodesy, known.roads
        self._newest: dict[int, Claim] = {}
        self._links = None if known.silence_s is None else PseudonymLinks(known.silence_s)

    def decoded(self, packets: list[ObservedPacket]) -> tuple[list[HeardClaim], list[HeardObject]]:
        """The claims of CAMs, and of bytes that pose as one, and the objects of CPMs."""
        cams: list[tuple[ObservedPacket, int, Cam | None]] = []
        objects: list[HeardObject] = []
        for packet in packets:
            kind, payload = _payload(packet.data)
            station_id = claimed_station_id(payload)
            if kind is CAM:
                cam = _cam(payload)
                self._find_place(cam)
                cams.append((packet, _NO_STATION if station_id is None else station_id, cam))
            elif kind is CPM:
                objects += self._objects(payload, packet.arrival_ns)
        if not cams or self.geodesy is None:
            return [], objects
        arrivals_ns = [packet.arrival_ns for packet, _, _ in cams]
        claims = claims_of_cams([cam for _, _, cam in cams], arrivals_ns, self.geodesy, self._roads)
        if self._links is not None:
            claims = self._links.linked(claims)
        for claim in claims:
            if claim.is_cam and np.isfinite(claim.x_m + claim.yaw_rad + claim.speed_mps):
                self._newest[claim.station_id] = claim
        heard = [
            HeardClaim(self._known_as(station_id), claim, packet.power_dbm)
            for (packet, station_id, _), claim in zip(cams, claims, strict=True)
        ]
        return heard, objects

    def around(self, now_ns: int) -> Mapping[int, Claim]:
        """The newest claims that are fresh; others are forgotten."""
        oldest_ns = now_ns - FRESH_S * 1e9
        self._newest = {n: one for n, one in self._newest.items() if one.arrival_ns >= oldest_ns}
        return dict(self._newest)

    def _find_place(self, cam: Cam | None) -> None:
        """Without fixes, the first CAM is the origin of a map without roads."""
        if self.geodesy is None and cam is not None and cam.latitude_deg is not None:
            longitude_deg = cam.longitude_deg
            if longitude_deg is not None and abs(cam.latitude_deg) < 90 and abs(longitude_deg) <= 180:
                self.geodesy = Geodesy(cam.latitude_deg, longitude_deg, 0.0)

    def _objects(self, payload: bytes, arrival_ns: int) -> list[HeardObject]:
        if self.geodesy is None:
            return []
        try:
            found = heard_objects(decode_cpm(payload), self.geodesy, arrival_ns) or []
        except MessageError:
            return []
        return [replace(one, station_id=self._known_as(one.station_id)) for one in found]

    def _known_as(self, station_id: int) -> int:
        """The first id of a station; this one where they keep theirs."""
        return station_id if self._links is None else self._links.known_as(station_id)


def _payload(data: bytes) -> tuple[object, bytes]:
    """The type of a packet's message by its port, and the message; a broken packet counts as a CAM."""
    try:
        port, _, payload = parse_btp_packet(data)
    except CamError:
        return CAM, b""
    return message_type_at(port) or CAM, payload


def _cam(payload: bytes) -> Cam | None:
    try:
        return decode_cam(payload)
    except CamError:
        return None

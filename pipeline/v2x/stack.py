"""The layers between facilities and radio: BTP, GeoNetworking and security."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.v2x.clock import clock_error_ns
from advpipe.pipeline.v2x.codec.btp import btp_packet, parse_btp_packet
from advpipe.pipeline.v2x.codec.cam_error import CamError, MessageError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.codec.denm_codec import DENM_CODEC
from advpipe.pipeline.v2x.facilities.cam import Cam, CamCore
from advpipe.pipeline.v2x.facilities.cam_tree import core_of_tree
from advpipe.pipeline.v2x.facilities.denm import RELEVANCE_M
from advpipe.pipeline.v2x.geonetworking.packet import (
    Area,
    PacketError,
    area_broadcast_content,
    broadcast_content,
    geonetworking_packet,
    parse_broadcast,
    parse_packet,
)
from advpipe.pipeline.v2x.geonetworking.position_vector import position_vector
from advpipe.pipeline.v2x.message_type import CAM, DENM, claimed_station_id, is_cam, message_type_of
from advpipe.pipeline.v2x.section import V2x
from advpipe.pipeline.v2x.security.pki import Holder, Pki, honest_ticket
from advpipe.pipeline.v2x.security.signer import EnvelopeSigner
from advpipe.pipeline.v2x.security.verifier import MessageVerifier, Rejection, SignatureChecks

_LOCATION = struct.Struct(">iiH")
"""ThreeDLocation (IEEE 1609.2): latitude and longitude in 1e-7 degrees, elevation in 0.1 m above -409.5 m."""
_SEA_LEVEL = 4095

LINK_BYTES = 38
"""LLC and SNAP (8), the MAC header of a QoS data frame (26), and its check sequence (4)."""


def mac_address(seed: int, station_id: int) -> bytes:
    """The address of the radio that uses a station id: six bytes, locally administered.

    GeoNetworking's address contains it.
    """
    drawn = named_generator(seed, "v2x", "mac", station_id).bytes(6)
    return bytes([drawn[0] & 0xFC | 0x02]) + drawn[1:]


class PacketBuilder:
    """Builds the packets that stations hand to their radios; `v2x.geonetworking` or `v2x.security` is on.

    start_ns: the begin of the drive. holders: the tickets of stations, by true station id, where they are
    others than the drive's own authority has issued to them.
    """

    def __init__(
        self, v2x: V2x, seed: int, start_ns: int, holders: Mapping[int, Holder] | None = None
    ) -> None:
        self._v2x, self._seed, self._rules = v2x, seed, v2x.security_rules
        self._pki = Pki.of(v2x, seed, start_ns) if v2x.security == "etsi" else None
        self._holders = holders or {}
        self._signers: dict[tuple[int, int], EnvelopeSigner] = {}
        self._macs: dict[int, bytes] = {}
        self._newest_cams: dict[int, bytes] = {}
        self._pseudonyms: dict[int, int] = {}
        self._counts: Counter[bytes] = Counter()
        self._clock_errors_ns: dict[int, int] = {}

    def packet(
        self,
        station_id: int,
        now_ns: int,
        payload: bytes,
        cam: Cam | CamCore | None = None,
        is_signed: bool = True,
    ) -> bytes:
        """The packet around a message, or around other bytes that pose as one.

        station_id: of the radio that sends it, which signs it. cam: what the payload says, if it is a CAM and
        that is known already. A CAM determines the sender's address and position in its packet; a message of
        another type has the position of the newest CAM that was `noted` for its sender, and the
        address of the station id that it claims. is_signed: whether it is signed where the drive's messages
        are.
        """
        kind = message_type_of(payload)
        if kind is CAM:
            cam = _cam(payload) if cam is None else cam
            mac = self._mac(station_id if cam is None else cam.station_id)
        else:
            cam = _cam(self._newest_cams.get(station_id, b""))
            mac = self._mac(claimed_station_id(payload) or station_id)
        vector, btp = position_vector(cam, mac, now_ns), btp_packet(payload, kind.port)
        if kind is DENM:
            content = area_broadcast_content(
                vector, btp, kind.traffic_class, _area(payload), self._count(mac)
            )
        else:
            content = broadcast_content(vector, btp, kind.traffic_class)
        if self._pki is None or not is_signed:
            return self._sent(geonetworking_packet(content), station_id, now_ns)
        local_ns = now_ns + self._clock_error_ns(station_id)
        location = _LOCATION.pack(vector.latitude, vector.longitude, _SEA_LEVEL) if kind is DENM else b""
        signed = self._signer(self._pki, station_id).sign(content, local_ns, kind.psid, location)
        return self._sent(geonetworking_packet(signed, is_secured=True), station_id, now_ns)

    def note(self, station_id: int, payload: bytes) -> None:
        """Note what a radio sends without an attack: the newest CAM, and the pseudonym that it uses now."""
        self._pseudonyms[station_id] = claimed_station_id(payload) or station_id
        if is_cam(payload):
            self._newest_cams[station_id] = payload

    def _sent(self, packet: bytes, station_id: int, now_ns: int) -> bytes:
        """The packet, or what a faulty radio sends of it."""
        share = self._rules.truncated_share
        if not share:
            return packet
        rng = named_generator(self._seed, "v2x", "truncated", station_id, now_ns)
        return packet[: int(rng.integers(1, len(packet)))] if rng.random() < share else packet

    def _signer(self, pki: Pki, station_id: int) -> EnvelopeSigner:
        """The signer of a radio, with the ticket of its present pseudonym."""
        pseudonym = self._pseudonyms.get(station_id, station_id)
        identity = station_id, pseudonym
        if identity not in self._signers:
            names = (station_id,) if pseudonym == station_id else identity
            holder = self._holders.get(station_id) or honest_ticket(pki, self._v2x, self._seed, names)
            interval_ns = round(self._rules.certificate_interval_s * 1e9)
            self._signers[identity] = EnvelopeSigner(holder, interval_ns)
        return self._signers[identity]

    def _clock_error_ns(self, station_id: int) -> int:
        if station_id not in self._clock_errors_ns:
            self._clock_errors_ns[station_id] = clock_error_ns(self._v2x, self._seed, station_id)
        return self._clock_errors_ns[station_id]

    def _count(self, mac: bytes) -> int:
        """The number of an address's next geographical broadcast."""
        self._counts[mac] += 1
        return self._counts[mac] - 1

    def _mac(self, station_id: int) -> bytes:
        if station_id not in self._macs:
            self._macs[station_id] = mac_address(self._seed, station_id)
        return self._macs[station_id]


class Delivery(NamedTuple):
    """A packet at the top of the stack. payload: None where a layer rejects it, for this reason."""

    payload: bytes | None
    rejection: Rejection | None
    done_ns: int


class ReceiverStack:
    """The layers of all receivers of a drive, without security or with it."""

    def __init__(self, v2x: V2x, seed: int, start_ns: int) -> None:
        self._rules = v2x.security_rules
        self._checks = (
            SignatureChecks(Pki.of(v2x, seed, start_ns).authority) if v2x.security == "etsi" else None
        )
        self._verifiers: dict[str, MessageVerifier] = {}

    def deliver(self, listener: str, packet: bytes, now_ns: int) -> Delivery:
        """What a packet that a listener receives now delivers; call it in the order of arrivals."""
        try:
            if self._checks is None:
                basic = parse_packet(packet)
                if basic.is_secured:
                    return Delivery(None, Rejection.MALFORMED, now_ns)
                return Delivery(_payload(basic.content), None, now_ns)
            if listener not in self._verifiers:
                self._verifiers[listener] = MessageVerifier(self._rules, self._checks)
            content, rejection, done_ns = self._verifiers[listener].verify(packet, now_ns)
            if content is None:
                return Delivery(None, rejection, done_ns)
            return Delivery(_payload(content), None, done_ns)
        except (PacketError, CamError):
            return Delivery(None, Rejection.MALFORMED, now_ns)


def _payload(content: bytes) -> bytes:
    """The message in the content of a packet. Raises CamError where it is at the port of another type."""
    packet = parse_btp_packet(parse_broadcast(content).btp)
    kind = message_type_of(packet.payload)
    if packet.destination_port != kind.port:
        raise CamError(f"a {kind.codec.name} is not for BTP-B port {packet.destination_port}")
    return packet.payload


def _area(payload: bytes) -> Area:
    """Where a DENM is relevant; around the origin of the Earth's grid for bytes that are none."""
    try:
        position = DENM_CODEC.decode(payload)["denm"]["management"]["eventPosition"]
    except MessageError:
        return Area(0, 0, 0)
    return Area(position["latitude"], position["longitude"], round(RELEVANCE_M))


def _cam(payload: bytes) -> CamCore | None:
    try:
        return core_of_tree(decode_cam_tree(payload))
    except CamError:
        return None

"""A drive's V2X in the format of VeReMi, for misbehaviour detectors that read it.

van der Heijden et al., "VeReMi", SecureComm 2018, and Kamel et al., "VeReMi Extension", IEEE ICC 2020. JSON,
one object a line. A file for each vehicle holds its own state (type 2) and what it received (type 3); one
more holds what was true of everything sent (type 4). Vectors are x, y and 0 on the map; `hed` is a unit
vector. A CAM does not contain its error, only a confidence: the `_noise` of a message is the claimed 95 %
half-width along each axis, as in CaTCH. Own states are the truth, with noise 0.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.labels.declaration import Published
from advpipe.pipeline.labels.messages import DROPPED, MessageLabel, read_labels
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.misbehaviour.claim import Claim, claims_of_cams
from advpipe.pipeline.replay.v2x_drive import V2xDrive, V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.facilities.cam import Cam
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.stages.evaluate.v2x.all_receivers import StationReception, receptions_of_all

FORMS: Mapping[str, Callable[[Published], int | None]] = {
    "extension": lambda published: published.veremi_extension,
    "2018": lambda published: published.veremi_2018,
}
"""The data sets' numbers of an attack. 0 is honest."""
FIRST_OF_OURS = 1000
"""Numbers from here on stand for attacks that a data set lacks, and for those of older bags, which do not
record a number; `attacks.json` lists all by name."""
ATTACKS_FILE, TRACE = "attacks.json", "trace"
_KIND = FolderKind("VeReMi export", (ATTACKS_FILE, TRACE), (ATTACKS_FILE,))
_DAY_NS = 86_400_000_000_000

Line = dict[str, object]
"""A line of JSON, or fields of one."""


class Exported(NamedTuple):
    """Counts of exported receivers, receptions and sent messages, and the numbers of attacks by name."""

    receivers: int
    received: int
    sent: int
    attacks: dict[str, int]


def export_veremi(bag: Path, out: Path, *, form: str = "extension", overwrite: bool = False) -> Exported:
    """Writes the folder `out`: attacks.json, and the messages in `trace/`.

    form: "extension" or "2018". Every vehicle with a radio is a receiver, instrumented or not, as in VeReMi:
    the bag records what the instrumented ones received, and the radio is simulated again for the others.
    Messages that are not CAMs or have no position cannot be expressed and are left out. Extension:
    `traceJSON-<id>-<pseudonym>-A<type>-<second>-0.json` and `traceGroundTruthJSON-0.json`, with
    `attackerType` and `RSSI` as the 2018 form has them; that one: `JSONlog-<index>-<id>-A<type>.json` and
    `GroundTruthJSONlog.json`. The type in a name is that of the vehicle, 0 if it never attacks;
    `attackerType` that of the message, 0 where it is not false. Of a mix, both are of the attack
    that was drawn. Times are seconds of the day that the drive begins on.

    Raises AdvpipeError for a bag without V2X or without true senders, an unknown form and an `out` that
    exists.
    """
    if form not in FORMS:
        raise UsageError(f"no form of VeReMi is named {form}; known: {', '.join(FORMS)}")
    reader = BagReader(bag)
    drive = V2xDrive(reader)
    labels = [label for label in read_labels(bag) if label.action != DROPPED]
    numbers = attack_numbers(sorted({label.attack_or_part for label in labels}), reader.provenance, form)
    with staged_folder(out, overwrite, _KIND) as folder:
        (folder / TRACE).mkdir()
        trace = _Trace(drive, labels, numbers, form, folder / TRACE)
        written = trace.write(receptions_of_all(reader, drive))
        (folder / ATTACKS_FILE).write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")
    return written


def attack_numbers(attacks: Sequence[str], provenance: Provenance, form: str) -> dict[str, int]:
    """The number of each attack of a bag, by its name, in a data set's form."""
    known: dict[str, int | None] = {}
    for one in provenance.fields.attacks:
        if one.declared is not None:
            known |= {part.name: FORMS[form](part.published) for part in one.declared.parts}
            known[one.type] = FORMS[form](one.declared.published)
    others = [attack for attack in attacks if known.get(attack) is None]
    return {a: known.get(a) or FIRST_OF_OURS + others.index(a) for a in attacks}


class _Trace:
    """One pass over a drive, a step in memory at a time."""

    def __init__(
        self,
        drive: V2xDrive,
        labels: Sequence[MessageLabel],
        numbers: Mapping[str, int],
        form: str,
        folder: Path,
    ) -> None:
        origin = drive.origin
        self._form, self._folder = form, folder
        self._geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self._attacks = dict(numbers)
        self._type_of_message = {one.number: numbers[one.attack_or_part] for one in labels if one.is_false}
        self._type_of_station = {one.station_id: numbers[one.attack_or_part] for one in reversed(labels)}
        self._index = {station: index for index, station in enumerate(sorted(drive.stations))}
        self._day_ns = 0

    def write(self, receptions: Iterable[tuple[V2xStep, Sequence[StationReception]]]) -> Exported:
        received_count = sent_count = 0
        receivers: set[int] = set()
        claims: dict[int, Claim] = {}
        requests_ns: dict[int, int] = {}
        before: dict[int, RadioPlace] = {}
        begin_ns: int | None = None
        before_ns = 0
        for step, received in receptions:
            if begin_ns is None:
                begin_ns, self._day_ns = step.begin_ns, step.begin_ns // _DAY_NS * _DAY_NS
            radios = {radio.station_id: radio for radio in step.radios}
            motion = {
                s: _Motion.of(radio, before.get(s), step.begin_ns, before_ns) for s, radio in radios.items()
            }
            lines: dict[int, list[str]] = {s: [self._own(motion[s])] for s in radios}
            claims.update(_claims(step.sent, self._geodesy))
            truths = [self._truth(one, claims, motion[one.station_id]) for one in step.sent]
            requests_ns.update((one.number, one.request_ns) for one in step.sent)
            for one in received:
                claim = claims[one.number]
                if math.isfinite(claim.x_m):
                    line = self._received(one, requests_ns[one.number], claim)
                    lines.setdefault(one.receiver, []).append(line)
                    received_count += 1
            self._append(self._truth_name(), truths)
            for station, own in lines.items():
                self._append(self._name(station, begin_ns), own)
            receivers |= set(lines)
            sent_count += len(step.sent)
            before, before_ns = radios, step.begin_ns
        return Exported(len(receivers), received_count, sent_count, self._attacks)

    def _append(self, name: str, lines: Sequence[str]) -> None:
        with (self._folder / name).open("a", encoding="utf-8") as file:
            file.writelines(lines)

    def _name(self, station: int, begin_ns: int) -> str:
        attack = self._type_of_station.get(station, 0)
        if self._form == "2018":
            return f"JSONlog-{self._index[station]}-{station}-A{attack}.json"
        return f"traceJSON-{station}-{station}-A{attack}-{(begin_ns - self._day_ns) // 10**9}-0.json"

    def _truth_name(self) -> str:
        return "GroundTruthJSONlog.json" if self._form == "2018" else "traceGroundTruthJSON-0.json"

    def _own(self, motion: _Motion) -> str:
        """Type 2."""
        head: Line = {"type": 2, "rcvTime": self._seconds(motion.time_ns)}
        values = motion.vectors()
        if self._form == "2018":  # its GPS record has a name of its own for the position's noise
            return _line(head | {"pos": values["pos"], "noise": values["pos_noise"], **_speed(values)})
        return _line(head | values)

    def _received(self, one: StationReception, request_ns: int, claim: Claim) -> str:
        """Type 3."""
        head: Line = {
            "type": 3,
            "rcvTime": self._seconds(one.arrival_ns),
            "sendTime": self._seconds(request_ns),
            "sender": one.sender,
        }
        message: Line = {"messageID": one.number}
        rssi: Line = {"RSSI": _finite(10 ** (one.power_dbm / 10))}
        values = _claimed_vectors(claim)
        if self._form == "2018":
            return _line(head | message | _place(values) | _speed(values) | rssi)
        return _line(head | {"senderPseudo": claim.station_id} | message | values | rssi)

    def _truth(self, one: Sent, claims: Mapping[int, Claim], motion: _Motion) -> str:
        """Type 4."""
        claim, values = claims.get(one.number), motion.vectors()
        attacker_type: Line = {"attackerType": self._type_of_message.get(one.number, 0)}
        message: Line = {"messageID": one.number}
        time_s = self._seconds(one.request_ns)
        if self._form == "2018":
            head: Line = {"type": 4, "time": time_s, "sender": one.station_id}
            return _line(head | attacker_type | message | _place(values) | _speed(values))
        pseudonym: Line = {"senderPseudo": one.station_id if claim is None else claim.station_id}
        head = {"type": 4, "sendTime": time_s, "sender": one.station_id}
        return _line(head | pseudonym | message | values | attacker_type)

    def _seconds(self, time_ns: int) -> float:
        return (time_ns - self._day_ns) / 1e9


class _Motion(NamedTuple):
    """How a station truly moves at a step."""

    time_ns: int
    place_m: tuple[float, float]
    velocity_mps: tuple[float, float]
    acceleration_mps2: tuple[float, float]
    heading: tuple[float, float]

    @classmethod
    def of(cls, radio: RadioPlace, before: RadioPlace | None, time_ns: int, before_ns: int) -> _Motion:
        pose, (x_mps, y_mps) = radio.map_SE3_base, radio.velocity_mps[:2].tolist()
        acceleration_mps2 = (0.0, 0.0)
        if before is not None:
            (old_x_mps, old_y_mps), step_s = before.velocity_mps[:2].tolist(), (time_ns - before_ns) / 1e9
            acceleration_mps2 = (x_mps - old_x_mps) / step_s, (y_mps - old_y_mps) / step_s
        yaw_rad = math.atan2(pose[1, 0], pose[0, 0])
        return cls(
            time_ns,
            (float(pose[0, 3]), float(pose[1, 3])),
            (x_mps, y_mps),
            acceleration_mps2,
            (math.cos(yaw_rad), math.sin(yaw_rad)),
        )

    def vectors(self) -> Line:
        values = (self.place_m, self.velocity_mps, self.acceleration_mps2, self.heading)
        return _vectors(values, ((0.0, 0.0),) * 4)


def _claims(sent: Sequence[Sent], geodesy: Geodesy) -> dict[int, Claim]:
    cams: list[Cam | None] = []
    for one in sent:
        try:
            cams.append(decode_cam(one.payload))
        except CamError:
            cams.append(None)
    claims = claims_of_cams(cams, [one.request_ns for one in sent], geodesy)
    return {one.number: claim for one, claim in zip(sent, claims, strict=True)}


def _claimed_vectors(claim: Claim) -> Line:
    """The claims of a CAM as vectors; 0 for what it does not contain, since JSON has no NaN."""
    yaw_rad = _finite(claim.yaw_rad)
    heading = (math.cos(yaw_rad), math.sin(yaw_rad))
    speed, faster = _finite(claim.speed_mps), _finite(claim.acceleration_mps2)
    values = (
        (claim.x_m, claim.y_m),
        (speed * heading[0], speed * heading[1]),
        (faster * heading[0], faster * heading[1]),
        heading,
    )
    turn_deg = math.degrees(claim.heading_confidence_rad)
    fast = claim.speed_confidence_mps
    noises = (
        (claim.position_m, claim.position_m),
        (abs(fast * heading[0]), abs(fast * heading[1])),
        (0.0, 0.0),
        (turn_deg, turn_deg),  # in degrees, as the data set has it
    )
    return _vectors(values, noises)


def _vectors(values: Sequence[tuple[float, float]], noises: Sequence[tuple[float, float]]) -> Line:
    found: Line = {}
    for name, value, noise in zip(("pos", "spd", "acl", "hed"), values, noises, strict=True):
        found |= {name: [*value, 0.0], f"{name}_noise": [*noise, 0.0]}
    return found


def _place(values: Line) -> Line:
    return {name: values[name] for name in ("pos", "pos_noise")}


def _speed(values: Line) -> Line:
    return {name: values[name] for name in ("spd", "spd_noise")}


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _line(values: Line) -> str:
    return json.dumps(values, separators=(",", ":"), allow_nan=False) + "\n"

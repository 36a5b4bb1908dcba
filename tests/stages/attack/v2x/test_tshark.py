"""tshark reads the attacks' messages, and reads what they were to say."""

from __future__ import annotations

import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_values import HIGH
from advpipe.stages.attack.gnss.change import spoof
from advpipe.stages.attack.registry import ATTACKS
from advpipe.stages.attack.v2x.change import forge

pytestmark = pytest.mark.oracle

LINK_TYPE = 147
FIELDS = ("its.stationID", "its.speedValue", "its.headingValue", "its.latitude", "its.longitude")
SPOOFED = ("gnss-relocate", "gnss-jam")
"""With a filter on board and without one: a CAM tells the estimate, another place, or none."""
V2X_ATTACK_NAMES = [name for name in ATTACKS if name.startswith("cam-")]


def read(payloads: list[bytes], path: Path) -> list[list[str]]:
    if (program := shutil.which("tshark")) is None:
        pytest.skip("tshark is not installed")
    records = [struct.pack("<IIII", 0, 0, len(one), len(one)) + one for one in payloads]
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, LINK_TYPE) + b"".join(records))
    command = [program, "-n", "-r", str(path), "-T", "fields", "-E", "occurrence=a", "-E", "aggregator=,"]
    command += ["-o", f'uat:user_dlts:"User 0 (DLT={LINK_TYPE})","its","0","","0",""']
    for field in (*FIELDS, "_ws.malformed"):
        command += ["-e", field]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return [line.split("\t") for line in lines]


def test_tshark_decodes_every_message_of_every_attack(recorded, tmp_path):
    reader = recorded()
    steps = [step for step in V2xDrive(reader).steps() if step.end_ns is not None]
    clean = {one.payload for step in steps for one in step.sent}
    payloads: list[bytes] = []
    specs = [
        attack_spec({"type": name, "victim": "ego", "attackers": {"share": 0.3}}) for name in V2X_ATTACK_NAMES
    ]
    changes = [forge(reader, [spec], 1) for spec in specs]
    for name in SPOOFED:
        victims = ("ego", next(name for name in V2xDrive(reader).stations.values() if name != "ego"))
        gnss = [attack_spec({"type": name, "victim": victim}) for victim in victims]
        changes.append(forge(reader, [], 1, spoof(reader, gnss, 1).editors()))
    for change in changes:
        payloads += [one.payload for step in steps for one in change.edited(step) if one.payload not in clean]
    assert len(payloads) > 1000
    lines = read(payloads, tmp_path / "attacks.pcap")
    assert len(lines) == len(payloads)
    for payload, (*values, malformed) in zip(payloads, lines, strict=True):
        tree = decode_cam_tree(payload)
        fast = tree["cam"]["camParameters"][HIGH][1]
        place = tree["cam"]["camParameters"]["basicContainer"]["referencePosition"]
        ours = (
            tree["header"]["stationID"],
            fast["speed"]["speedValue"],
            fast["heading"]["headingValue"],
            place["latitude"],
            place["longitude"],
        )
        assert malformed == ""
        assert values == [str(value) for value in ours]

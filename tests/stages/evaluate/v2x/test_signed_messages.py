"""The report of a signed drive says what security stopped."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("cryptography")

from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.v2x.section import v2x_sections
from advpipe.stages.evaluate.v2x.signed_messages import security_sections
from advpipe.stages.simulate.run import simulate

COARSE = ("sensors.lidars.lidar.channels=2", "sensors.lidars.lidar.points_per_second=4000")


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The clean bag of a signed drive."""
    out = tmp_path_factory.mktemp("signed") / "smoke"
    settings = [*COARSE, "simulation.duration_s=3", "v2x.penetration=1", "v2x.security=etsi"]
    simulate(load_scenario("smoke", settings), out)
    return out / "clean"


def test_an_outsider_is_stopped_and_an_insider_is_not(signed: Path) -> None:
    bags = []
    for credentials in ("ticket", "none"):
        bags.append(signed.parent / credentials)
        spec = AttackSpec(type="cam-position-offset", credentials=credentials)  # type: ignore[arg-type]
        attack(signed, bags[-1], AttackRequest((spec,)))
    (found,) = security_sections(signed, bags)
    clean, insider, others, outsider, _ = found.records
    assert (clean.attack, clean.attacker) == ("", "")
    assert {one.reason for one in clean.rejected} == {"unknown signer"}  # before the first certificate
    assert (insider.attacker, insider.credentials) == ("insider", "ticket")
    assert (outsider.attacker, outsider.credentials) == ("outsider", "none")
    assert insider.received == outsider.received >= insider.accepted > 5
    assert insider.stopped < 0.5 < outsider.stopped == 1
    assert [(one.reason, one.messages) for one in outsider.rejected] == [("unsigned", outsider.received)]
    assert others.received + insider.received == clean.received
    assert found.tables[0].lines[3][:3] == ("none", "cam-position-offset", "outsider")
    (printed,) = found.terminal
    assert printed.lines[3] == ("none", "outsider", f"{outsider.received:,}", "0", "100.0")
    assert found.lead.startswith("Of outsiders' messages, receivers rejected 100.0 %.")
    (judged,) = v2x_sections(signed, bags)
    scored = {record.bag: record.false_messages for record in judged.records}
    assert scored["none"] == 0 < scored["ticket"] <= insider.accepted


def test_a_drive_without_security_has_no_section(smoke: Path) -> None:
    assert security_sections(smoke, []) == ()

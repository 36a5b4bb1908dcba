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
from advpipe.stages.evaluate.v2x.signed_messages import security_tables
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
    (found,) = v2x_sections(signed, bags)
    table = found.tables[-1]
    clean, insider, outsider = table.lines
    assert clean[1] == "0"
    assert int(insider[1]) == int(outsider[1]) > int(insider[2]) > 5
    assert outsider[2:5] == ("0", "100.0", f"{outsider[1]} unsigned")
    assert clean[7].endswith("unknown signer")  # before the first certificate
    scored = {record.bag: record.false_messages for record in found.records}
    assert scored["none"] == 0 < scored["ticket"] <= int(insider[2])


def test_a_drive_without_security_has_no_table(smoke: Path) -> None:
    assert security_tables([(smoke, "clean")]) == ()

"""Shares of a whole that are written in percent, in scenarios and to programs that check them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jsonschema
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.section import parse_share
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import Attackers, attack_spec
from advpipe.pipeline.scenario.schema import scenario_schema


@pytest.mark.parametrize(
    ("written", "share"),
    [
        ("1%", 0.01),
        ("0.3 %", 0.003),
        ("100%", 1.0),
        ("250%", 2.5),  # bounds are whose key it is
        ("1", "1"),
        ("%", "%"),
        ("-1%", "-1%"),
        ("1e2%", "1e2%"),
        ("1%%", "1%%"),
        (f"{'9' * 31}%", f"{'9' * 31}%"),
        (0.5, 0.5),
        (None, None),
    ],
)
def test_worked_out_by_hand(written: object, share: object) -> None:
    assert parse_share(written) == share


def test_shares_of_a_scenario_may_be_in_percent() -> None:
    scenario = load_scenario(
        "smoke", {"v2x.penetration": "30%", "sensors.lidars.lidar.dropoff_general_rate": "2 %"}
    )
    assert scenario.v2x.penetration == 0.3
    assert scenario.sensors.lidars["lidar"].dropoff_general_rate == 0.02
    assert Attackers(share="20%").share == 0.2  # type: ignore[arg-type]
    spec = attack_spec({"type": "cam-dos", "schedule": {"kind": "random", "probability": "5%"}})
    assert spec.schedule.probability == 0.05


@pytest.mark.parametrize("setting", ["v2x.penetration=130%", "v2x.penetration=x%", "traffic.vehicles=5%"])
def test_bounds_stay_and_other_keys_take_no_percent(setting: str) -> None:
    with pytest.raises(AdvpipeError, match=r"settings (v2x\.penetration|traffic\.vehicles): Input should be"):
        load_scenario("smoke", [setting])


@pytest.mark.oracle
@pytest.mark.parametrize(("value", "fits"), [("30%", True), (0.3, True), ("x%", False), (1.5, False)])
def test_the_schema_says_so_too(value: Any, fits: bool, tmp_path: Path) -> None:
    tree = {"name": "x", "map": {"sumo_net": "a.net.xml"}, "v2x": {"penetration": value}}
    assert jsonschema.Draft202012Validator(scenario_schema()).is_valid(tree) == fits

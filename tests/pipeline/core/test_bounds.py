"""Every number of a scenario has bounds; nonsensical values are refused with their place."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.section import Section
from advpipe.pipeline.scenario import load_scenario, shipped_scenarios
from advpipe.pipeline.scenario.schema import scenario_schema

SCHEMA = scenario_schema()


def numbers(node: dict[str, Any], place: tuple[str, ...] = ()) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every number of the schema: its place and its own schema."""
    if "$ref" in node:
        node = SCHEMA["$defs"][node["$ref"].rpartition("/")[2]]
    if node.get("type") in ("number", "integer"):
        yield ".".join(place), node
    for name, part in node.get("properties", {}).items():
        yield from numbers(part, (*place, name))
    parts = [*node.get("anyOf", []), *node.get("patternProperties", {}).values()]
    parts += [node[key] for key in ("items", "additionalProperties") if isinstance(node.get(key), dict)]
    for part in parts:
        yield from numbers(part, place)


NUMBERS = dict(numbers(SCHEMA))


def test_every_number_is_bounded_on_both_sides() -> None:
    assert len(NUMBERS) > 100
    for place, node in NUMBERS.items():
        least = node.get("minimum", node.get("exclusiveMinimum"))
        most = node.get("maximum", node.get("exclusiveMaximum"))
        assert "enum" in node or (least is not None and most is not None), place
        assert "enum" in node or (abs(least) < 1e20 and abs(most) < 1e20), place
        # What has to be above zero has a least of its own: 1e-300 is above it, too.
        assert node.get("exclusiveMinimum") != 0 or node.get("minimum", 0) > 0, place


def sections(kind: type[BaseModel] = Section) -> Iterator[type[BaseModel]]:
    for each in kind.__subclasses__():
        yield each
        yield from sections(each)


def test_no_bound_hides_another() -> None:
    """Of two bounds of a field, pydantic keeps its type's, not the narrower one of the key."""
    assert len(set(sections())) > 20
    for section in sections():
        for name, field in section.model_fields.items():
            bounds = [each for each in field.metadata if isinstance(each, Ge | Gt | Le | Lt)]
            assert len({type(each) for each in bounds}) == len(set(bounds)), (section, name)


ODD = {
    "simulation.step_s=2": "step_s: .*less than or equal to 1, not 2",
    "sensors.radars={r: {false_alarm_probability: 0}}": r"false_alarm_probability: .*equal to 0\.0+1, not 0",
    "sensors.lidars.lidar.x_m=1e30": r"x_m: .*less than or equal to 20, not 1e\+30",
    "sensors.lidars.lidar.range=1e-300": "range: .*greater than or equal to 1, not 1e-300",
    "environment.objects=[{mesh: a.ply, x_m: 1e30}]": r"objects\[0\]\.x_m: .*less than or equal to 100000",
    "environment.objects=[{mesh: a.ply, yaw_rad: 90}]": r"yaw_rad: .*less than or equal to 6\.3",
    "sensors.gnss.rate_hz=1e-300": r"rate_hz: .*equal to 0\.001",
    "simulation.duration_s=true": "duration_s: Input should be a valid number, not True",
    "traffic.vehicles=true": "vehicles: Input should be a valid integer, not True",
    "traffic.vehicles='5'": "vehicles: Input should be a valid integer, not '5'",
    "traffic.vehicles=1000000000": "vehicles: .*less than or equal to 5000",
    "traffic.vehicles=1e9": "vehicles: .*less than or equal to 5000",
    "traffic.vehicles=80.5": "vehicles: Input should be a valid integer",
    "traffic.mix={sedan: true}": r"mix\.sedan: .*valid number, not True",
    "sensors.lidars.lidar.vertical_angles_deg=[-1, true]": "upper_fov: .*valid number, not True",
    "recording.markers=1": "markers: Input should be a valid boolean, not 1",
    "v2x.enabled='off'": "enabled: Input should be a valid boolean",
    "environment.weather={kind: rain, rate_mm_per_h: 1e-300}": "rain needs its rate_mm_per_h, of at least",
    "attacks.x.type=" + "x" * 100_000: r"attacks\.x.*at most 200 characters",
    "sensors.lidars.lidar.preset=" + "x" * 100_000: "preset 'x.* is unknown",
    "x" * 100_000 + "=1": "unknown key",
    "traffic.mix." + "x" * 100_000 + "=1": "at most 200 characters",
    "map.opendrive=" + "x" * 100_000: "at most 4096 characters",
    "name=" + "a" * 100_000: "name: .*at most 80 characters",
}


@pytest.mark.parametrize(("override", "message"), ODD.items(), ids=[text[:50] for text in ODD])
def test_nonsensical_values_give_a_short_one_line_error(override: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_scenario("smoke", [override])
    assert len(str(caught.value)) < 500


MANY = ", ".join(f"l{i}: {{points_per_second: 20000000, rotation_frequency: 10}}" for i in range(6))
HUGE = {
    r"the recording would take about 2\d TB, over 10 TB": ["sensors.lidars={lidar: {}}"],
    r"the drive would take 1,000,0\d\d,000 steps, over 20,000,000": [
        *("simulation.step_s=0.001", "sensors.imu.rate_hz=2000", "v2x.ldm.rate_hz=10")
    ],
    "one turn of all LiDARs has 12,000,000 rays, over 10,000,000": ["sensors.lidars={" + MANY + "}"],
}


@pytest.mark.parametrize(("message", "settings"), HUGE.items(), ids=["bytes", "steps", "rays"])
def test_scenarios_too_large_for_disk_or_memory_are_refused_with_the_estimate(
    message: str, settings: list[str]
) -> None:
    with pytest.raises(AdvpipeError, match=message):
        load_scenario("smoke", ["simulation.duration_s=1e6", *settings])


def test_numbers_may_be_written_in_any_common_form() -> None:
    written = ["sensors.lidars.lidar.points_per_second=1e5", "v2x.radio.frequency_hz=5.9e9"]
    scenario = load_scenario("smoke", [*written, "traffic.vehicles=5.0", "traffic.mix={sedan: 1e3}"])
    assert scenario.sensors.lidars["lidar"].points_per_second == 100_000
    assert scenario.v2x.radio.frequency_hz == 5.9e9
    assert scenario.traffic.vehicles == 5
    assert isinstance(scenario.traffic.vehicles, int)
    assert scenario.traffic.mix == {"sedan": 1000.0}


@pytest.mark.parametrize("name", sorted(shipped_scenarios()))
def test_shipped_scenarios_are_within_the_bounds(name: str) -> None:
    assert load_scenario(name).name == name


def test_an_override_changes_only_one_copy_of_an_aliased_section(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    lidars = "sensors: {lidars: {a: &l {range: 50}, b: *l}}\n"
    path.write_text(f"name: a\nmap: {{sumo_net: boulevard.net.xml}}\n{lidars}")
    changed = load_scenario(str(path), ["sensors.lidars.a.range=60"]).sensors.lidars
    assert (changed["a"].range, changed["b"].range) == (60, 50)

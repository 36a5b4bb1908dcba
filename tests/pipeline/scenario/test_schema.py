"""The oracle is the `jsonschema` package."""

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import dump_scenario, load_scenario, shipped_scenarios
from advpipe.pipeline.scenario.schema import scenario_schema, schema_json


class PlainLoader(yaml.SafeLoader):
    """Dates stay text, as editors see them."""


PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}

VALIDATOR = jsonschema.Draft202012Validator(scenario_schema())
SMALLEST: dict[str, Any] = {"name": "x", "map": {"sumo_net": "a.net.xml"}}


def plain(text: str) -> Any:
    return yaml.load(text, Loader=PlainLoader)


@pytest.mark.oracle
def test_the_schema_is_valid() -> None:
    jsonschema.Draft202012Validator.check_schema(scenario_schema())
    assert json.loads(schema_json()) == scenario_schema()


@pytest.mark.oracle
@pytest.mark.parametrize("name", shipped_scenarios())
def test_shipped_scenarios_fit_the_schema(name: str) -> None:
    tree = plain(shipped_scenarios()[name].read_text(encoding="utf-8"))
    VALIDATOR.validate(tree)
    if name != "town06":  # whose map is the user's
        VALIDATOR.validate(plain(dump_scenario(load_scenario(name))))


@pytest.mark.oracle
@pytest.mark.parametrize(
    "change",
    [
        {"sed": 1},
        {"simulation": {"seeds": 1}},
        {"simulation": {"duration_s": 0}},
        {"map": {"sumo_net": 3}},
        {"vehicles": {"Bad Name": {}}},
        {"sensors": {"lidars": {"lidar": {"channels": 0}}}},
        {"recording": {"compression": "gzip"}},
        {"traffic": {"vehicles": -1}},
    ],
)
def test_scenarios_that_loading_refuses_do_not_fit_the_schema(tmp_path: Path, change: dict[str, Any]) -> None:
    tree = {**SMALLEST, **change}
    assert not VALIDATOR.is_valid(tree)
    (tmp_path / "x.yaml").write_text(yaml.safe_dump(tree))
    with pytest.raises(AdvpipeError):
        load_scenario(str(tmp_path / "x.yaml"))


def test_every_section_is_described_and_closed() -> None:
    schema = scenario_schema()
    for name, section in {"Scenario": schema, **schema["$defs"]}.items():
        assert section["additionalProperties"] is False, name
        assert section["description"], name


def test_paths_are_marked_and_defaults_stated() -> None:
    definitions = scenario_schema()["$defs"]
    opendrive = definitions["Map"]["properties"]["opendrive"]
    assert {"type": "string", "format": "path", "minLength": 1, "maxLength": 4096} in opendrive["anyOf"]
    assert opendrive["description"] == "path of an OpenDRIVE .xodr file"
    assert definitions["UserBody"]["properties"]["mesh"]["format"] == "path"
    assert definitions["Simulation"]["properties"]["duration_s"]["default"] == 20.0

"""Grid files: every combination is a drive, and every mistake is one line."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter

sys.path.insert(0, str(Path(__file__).parent))

from grids import DETACH, write_grid_file

from advpipe.pipeline.campaigns.grid.load import load_grid
from advpipe.pipeline.campaigns.grid.models import Factor, grid_schema_json
from advpipe.pipeline.core.errors import UsageError

FOG = {"kind": "fog", "visibility_m": 50}


def test_every_combination_is_a_drive(tmp_path: Path) -> None:
    factors = {
        "weather": {"clear": {}, "fog": {"environment.weather": FOG}},
        "traffic.vehicles": [10, 20],
    }
    loaded = load_grid(write_grid_file(tmp_path, factors=factors, seeds=[3, 5]))
    assert [(tuple(drive.levels.values()), drive.seed) for drive in loaded.drives] == [
        ((weather, vehicles), seed)
        for weather in ("clear", "fog")
        for vehicles in (10, 20)
        for seed in (3, 5)
    ]
    last = loaded.drives[-1].scenario
    assert (last.simulation.seed, last.traffic.vehicles) == (5, 20)
    assert (last.environment.weather.kind, last.environment.weather.visibility_m) == ("fog", 50)
    assert loaded.file.cells == 8


def test_the_name_of_a_drive_depends_on_its_scenario_alone(tmp_path: Path) -> None:
    (one,) = load_grid(write_grid_file(tmp_path, factors={"traffic.vehicles": [10]})).drives
    (same,) = load_grid(write_grid_file(tmp_path, factors={"few": {"ten": {"traffic.vehicles": 10}}})).drives
    (other,) = load_grid(write_grid_file(tmp_path, factors={"traffic.vehicles": [11]})).drives
    assert one.id == same.id != other.id


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"seed": 3}, "unknown key; did you mean 'seeds'?"),
        ({"seeds": [1, 1]}, "1 is given twice"),
        ({"seeds": [-1]}, "greater than or equal to 0"),
        ({"attacks": None}, "attacks: is missing"),
        ({"attacks": {"a": {"type": "detahc"}}}, "did you mean 'detach'?"),
        ({"attacks": {"a": {**DETACH, "frames": "::2"}}}, "attacks.a: give `frames` at the top of the grid"),
        ({"attacks": {"clean": DETACH}}, "attacks.clean: the drive itself is named so"),
        ({"defences": ["jiter"]}, "defences"),
        ({"defences": ["all"]}, "'all' is not one defence; name each"),
        ({"frames": "x"}, "expected start:stop:step"),
        ({"settings": {"simulation.seed": 3}}, "simulation.seed is set by `seeds`"),
        ({"settings": {"traffic.vehicels": 3}}, "traffic.vehicels: unknown key"),
        ({"factors": {"traffic.vehicles": []}}, "factors"),
        ({"factors": {"traffic.vehicles": [1, 1]}}, "level 1 is given twice"),
        ({"factors": {"traffic.vehicles": [1, -1]}}, r"\(traffic.vehicles = -1\)"),
        ({"factors": {"traffic.vehicles": [40], "x": {"a": {}, "b": {}}}}, "are the same drive"),
        ({"scenario": "smok"}, "did you mean 'smoke'?"),
    ],
)
def test_mistakes_are_one_line(tmp_path: Path, keys: dict[str, Any], line: str) -> None:
    with pytest.raises(UsageError, match=line) as caught:
        load_grid(write_grid_file(tmp_path, **keys))
    assert "\n" not in str(caught.value)
    assert "grid.yaml" in str(caught.value)


def test_a_mistake_names_its_line(tmp_path: Path) -> None:
    path = tmp_path / "grid.yaml"
    path.write_text("name: a\nscenario: smoke\nattacks: {a: {type: detach}}\ndetectorz: [small]\n")
    with pytest.raises(UsageError, match=r"grid\.yaml: detectorz \(line 4\): unknown key"):
        load_grid(path)
    for text in ("[]", "a: [", ""):
        path.write_text(text)
        with pytest.raises(UsageError, match=r"grid\.yaml"):
            load_grid(path)


def test_the_schema_has_every_key() -> None:
    schema = json.loads(grid_schema_json())
    assert {"name", "scenario", "factors", "seeds", "attacks", "detectors", "defences"} <= set(
        schema["properties"]
    )
    assert schema["additionalProperties"] is False
    assert TypeAdapter(Factor).validate_python([1, "a"]) == [1, "a"]


def test_the_grids_of_the_documentation(tmp_path: Path) -> None:
    page = (Path(__file__).parents[4] / "docs" / "grids.md").read_text(encoding="utf-8")
    texts = [block.partition("```")[0] for block in page.split("```yaml\n")[1:]]
    grids = []
    for text in texts:
        (tmp_path / "grid.yaml").write_text(text)
        grids.append(load_grid(tmp_path / "grid.yaml"))
    loaded, of_messages = grids
    assert len(of_messages.drives) == 15
    assert f"= {len(loaded.drives)} drives and {loaded.file.cells} cells" in page

"""The section `map`: one source, and a generator within bounds."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario import load_scenario

BAD = {
    "map.generator={size: 1}": r"map\.generator\.size: .*greater than or equal to 2, not 1",
    "map.generator={kind: square}": r"map\.generator\.kind: .*'grid', 'spider' or 'random'",
    "map.generator={lanes: 0}": r"map\.generator\.lanes: ",
    "map.generator={block_m: 0}": r"map\.generator\.block_m: ",
    "map.generator={blok_m: 100}": r"unknown key; did you mean 'block_m'\?",
    "map={}": r"exactly one of opendrive, sumo_net and generator",
    "map={sumo_net: a.net.xml, generator: {}}": r"exactly one of opendrive, sumo_net and generator",
}


@pytest.mark.parametrize(("override", "message"), BAD.items())
def test_errors_name_invalid_maps(override: str, message: str) -> None:
    with pytest.raises(AdvpipeError, match=message) as caught:
        load_scenario("smoke", [override])
    assert "\n" not in str(caught.value)


def test_an_overridden_source_replaces_the_files() -> None:
    scenario = load_scenario("smoke", ["map.generator={kind: spider, size: 5}"])
    assert scenario.map.sumo_net is None
    assert scenario.map.generator is not None
    assert (scenario.map.generator.kind, scenario.map.generator.size) == ("spider", 5)

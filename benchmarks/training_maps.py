"""Makes the maps that benchmarks/train_small.sh trains on again, and writes the list of their checksums.

    python benchmarks/training_maps.py [--check]

The list lies beside the checkpoint, `small.maps.json`; reports are marked by it (see
`pipeline.detector.training_maps`). With --check nothing is written, and a difference fails. Generated
networks follow from their settings, their seed and the version of SUMO, which the list names.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.versions import installed
from advpipe.pipeline.detector.second.family import SHIPPED
from advpipe.pipeline.detector.training_maps import list_beside
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.road_network.network import load_network

SCRIPT = Path(__file__).with_name("train_small.sh")
NETWORKS = SCRIPT.parents[1] / "scenarios" / "networks"
NOT_TRAINED_ON = ("valid", "valid_hdl64")
"""Drives that the script makes for another purpose."""


AGAIN = 200
"""What the script adds to the seed of a drive that it makes again; those of the world before share maps."""


@dataclass(frozen=True)
class Drive:
    """A line of the script: the name, and the settings of `advpipe simulate training` that make its map."""

    name: str
    settings: tuple[str, ...]


def drives(script: Path = SCRIPT) -> Iterator[Drive]:
    """The drives that the script trains on, in its order."""
    text = script.read_text(encoding="utf-8").replace("\\\n", " ")
    for line in re.findall(r"^(?:generated|shipped) .*$", text, flags=re.MULTILINE):
        kind, name, seed, *rest = shlex.split(line)
        settings = []
        if kind == "shipped":
            settings.append(f"map.sumo_net={NETWORKS / rest[0]}.net.xml")
        else:
            keys = ("kind", "size", "block_m", "lanes")
            settings += ["map.sumo_net=null"]
            settings += [f"map.generator.{key}={value}" for key, value in zip(keys, rest[:4], strict=True)]
            speed = [
                argument.removeprefix("$speed=") for argument in rest[4:] if argument.startswith("$speed=")
            ]
            settings += [f"map.generator.speed_mps={value}" for value in speed]
        if name not in NOT_TRAINED_ON:
            yield Drive(name, (f"simulation.seed={seed}", *settings))
            yield Drive(f"{name}-again", (f"simulation.seed={int(seed) + AGAIN}", *settings))


def map_sha256(drive: Drive) -> str:
    """What the record of a bag of this drive has as `map_sha256`."""
    scenario = load_scenario("training", list(drive.settings))
    with tempfile.TemporaryDirectory() as scratch:
        return load_network(scenario.map, Path(scratch), scenario.simulation.seed).map_sha256


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare with the list, write nothing")
    is_check = parser.parse_args().check
    checkpoint = SHIPPED["small"]
    made = {drive.name: map_sha256(drive) for drive in drives()}
    document = {
        "checkpoint_sha256": sha256_of(checkpoint),
        "made_with": f"eclipse-sumo {installed('eclipse-sumo')}",
        "maps_sha256": made,
    }
    text = json.dumps(document, indent=1) + "\n"
    target = list_beside(checkpoint)
    if is_check:
        sys.exit(0 if target.read_text(encoding="utf-8") == text else f"{target} differs from these maps")
    target.write_text(text, encoding="utf-8")
    print(f"{target}: {len(made)} drives on {len(set(made.values()))} maps")


if __name__ == "__main__":
    main()

"""Where a bag comes from: one MCAP metadata record of strings, protected by a checksum.

Keys: `kind` ("clean" or "attack"), `scenario` (YAML), `scenario_name`, `seed`, `versions` (JSON). An
imported drive has `source` (YAML) instead of scenario and seed. A simulated drive adds `map_sha256`; an
attack `parent_sha256`, `attack`, `recipe`, `parameters` (JSON), `budget` (the parameter that bounds the
attack), `frames`, `debug` (whether the bag may have debug topics, see `messages.debug`) and `code_sha256`
(see `pipeline.code`); one on clouds also `lidar_topics` (JSON), `looks` (at how many tries, where the
attack says so) and `baseline_tries` (at how many its random baseline looks).
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path

from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.versions import installed

RECORD_NAME = "advpipe"
_CHECKSUM = "crc32"  # MCAP lays no checksum over a single metadata record

_EVERYWHERE = ("advpipe", "mcap", "numpy", "rosbags", "scipy", "zstandard")
_SIMULATION = ("eclipse-sumo", "libsumo", "open3d", "open3d-cpu", "shapely")
_ATTACK = ("torch",)


def clean_provenance(scenario_name: str, scenario_yaml: str, seed: int, map_sha256: str) -> dict[str, str]:
    """The record of a simulated drive: the resolved scenario file, and the map's file by its checksum."""
    return {
        "kind": "clean",
        "scenario_name": scenario_name,
        "scenario": scenario_yaml,
        "seed": str(seed),
        "map_sha256": map_sha256,
        "versions": _versions_json(_EVERYWHERE + _SIMULATION),
    }


def imported_provenance(name: str, source_yaml: str) -> dict[str, str]:
    """The record of a drive that was imported: its name there, and the text of source.yaml."""
    return {
        "kind": "clean",
        "scenario_name": name,
        "source": source_yaml,
        "versions": _versions_json(_EVERYWHERE),
    }


def attack_provenance(
    parent: Path,
    parent_provenance: Mapping[str, str],
    *,
    attack: str,
    recipe: str,
    parameters: Mapping[str, object],
    seed: int,
    frames: str,
) -> dict[str, str]:
    """The record of an adversarial bag made from the bag `parent`, another tool's bag included.

    It keeps the parent's scenario and map; `seed` is the attack's own; the first parameter is its budget.
    """
    inherited = {
        key: parent_provenance[key]
        for key in ("scenario_name", "scenario", "source", "map_sha256")
        if key in parent_provenance
    }
    return {
        **inherited,
        "kind": "attack",
        "parent_sha256": parent_sha256(parent),
        "attack": attack,
        "recipe": recipe,
        "parameters": json.dumps(parameters, sort_keys=True),
        "budget": next(iter(parameters), ""),
        "seed": str(seed),
        "frames": frames,
        "versions": _versions_json(_EVERYWHERE + _ATTACK),
    }


def _versions_json(packages: tuple[str, ...]) -> str:
    """The versions of those of the packages that are installed, as JSON."""
    versions = {package: installed(package) for package in packages}
    return json.dumps({package: number for package, number in versions.items() if number}, sort_keys=True)


def with_checksum(provenance: Mapping[str, str]) -> dict[str, str]:
    """The record to write: the provenance and its checksum."""
    return {**provenance, _CHECKSUM: _checksum(provenance)}


def checked_provenance(record: Mapping[str, str], path: Path) -> Provenance:
    """The provenance in a record; a record that was changed, or is none, is refused."""
    provenance = {key: value for key, value in record.items() if key != _CHECKSUM}
    if record.get(_CHECKSUM) != _checksum(provenance):
        raise AdvpipeError(f"{path}: the provenance record is damaged (checksum); record the bag again")
    return Provenance(provenance, f"{path}: the provenance record")


def parent_sha256(bag: Path) -> str:
    """SHA-256 over the bytes of the bag's .mcap file(s), in their order: an attack's `parent_sha256`.

    For a bag of one file it is what `sha256sum` prints.
    """
    return sha256_of(*mcap_files(bag))


def _checksum(provenance: Mapping[str, str]) -> str:
    return f"{zlib.crc32(json.dumps(sorted(provenance.items())).encode()):08x}"

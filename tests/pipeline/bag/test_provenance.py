import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.bag.provenance import (
    attack_provenance,
    checked_provenance,
    clean_provenance,
    parent_sha256,
    with_checksum,
)
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError

Record = Callable[..., Path]


def test_a_bag_states_where_it_comes_from(tmp_path: Path, record: Record) -> None:
    assert BagReader(record(tmp_path / "bag")).provenance == {
        "kind": "clean",
        "scenario": "a: 1\nb: ü\n",
        "seed": "7",
    }


def test_parent_is_named_by_its_bytes(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag")
    expected = hashlib.sha256((bag / "bag_0.mcap").read_bytes()).hexdigest()
    assert parent_sha256(bag) == parent_sha256(bag / "bag_0.mcap") == expected


def test_a_simulated_drive_names_what_made_it() -> None:
    drive = clean_provenance("town", "a: 1\n", 7, "0" * 64)
    versions = json.loads(drive.pop("versions"))
    assert drive == {
        "kind": "clean",
        "scenario": "a: 1\n",
        "scenario_name": "town",
        "seed": "7",
        "map_sha256": "0" * 64,
    }
    made_by = {
        "advpipe",
        "eclipse-sumo",
        "libsumo",
        "numpy",
        "scipy",
        "shapely",
        "mcap",
        "rosbags",
        "zstandard",
    }
    assert made_by <= set(versions)
    assert {"open3d", "open3d-cpu"} & set(versions)
    assert versions["numpy"] == np.__version__


def test_an_attack_keeps_the_scenario_of_its_parent(tmp_path: Path, record: Record) -> None:
    bag = record(tmp_path / "bag")
    clean = clean_provenance("town", "a: 1\n", 7, "0" * 64)
    attack = attack_provenance(
        bag,
        clean,
        attack="detach",
        recipe="best",
        parameters={"ratio": 0.01, "depth": 2},
        seed=3,
        frames="0:30:1",
    )
    assert attack["kind"] == "attack"
    assert (attack["scenario"], attack["scenario_name"], attack["seed"]) == ("a: 1\n", "town", "3")
    assert attack["parent_sha256"] == parent_sha256(bag)
    assert json.loads(attack["parameters"]) == {"ratio": 0.01, "depth": 2}
    assert attack["budget"] == "ratio"
    assert json.loads(clean["versions"])["mcap"]
    assert all(isinstance(value, str) for value in attack.values())


def test_a_changed_record_is_refused() -> None:
    record = with_checksum({"kind": "clean", "seed": "7"})
    assert checked_provenance(record, Path("bag")) == {"kind": "clean", "seed": "7"}
    for changed in ({**record, "seed": "8"}, {**record, "more": ""}, {"kind": "clean", "seed": "7"}):
        with pytest.raises(AdvpipeError, match="damaged"):
            checked_provenance(changed, Path("bag"))

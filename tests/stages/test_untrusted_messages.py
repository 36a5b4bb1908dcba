"""Messages of a drive, field by field with odd values: every command ends with one line, or works."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.simulate.run import simulate

sys.path.insert(0, str(Path(__file__).parent))

from mutated_messages import SENSED, SMALL, V2X, WHOLE, Mutation, failures, mutations_of, write_mutated

NIGHTLY = pytest.mark.nightly
ON_THE_AIR = ("inspect", "verify", "export", "cam", "gnss", "evaluate")
ON_BOARD = ("inspect", "verify", "gnss", "evaluate", "evaluate alone", "share")


def some(names: Iterable[str], *daily: str) -> list[Any]:
    """These names; all but a few are left to the nightly run."""
    return [pytest.param(name, marks=[] if name in daily else [NIGHTLY]) for name in names]


@pytest.fixture(scope="session")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a second of a few vehicles."""
    folder = tmp_path_factory.mktemp("untrusted") / "drive"
    simulate(load_scenario("smoke", SMALL), folder)
    return folder / "clean"


def try_all(clean: Path, tmp_path: Path, mutations: list[Mutation], commands: tuple[str, ...]) -> None:
    for number, mutation in enumerate(mutations):
        bag = tmp_path / str(number)
        write_mutated(clean, bag, mutation)
        assert failures(clean, bag, commands) == [], mutation.name


@pytest.mark.parametrize("name", some(WHOLE, "shifted", "none", "unknown ids"))
@pytest.mark.parametrize("topic", V2X)
def test_mutated_radio_messages_are_handled(clean: Path, tmp_path: Path, topic: str, name: str) -> None:
    try_all(clean, tmp_path, [Mutation(topic, name, WHOLE[name])], ON_THE_AIR)


@pytest.mark.parametrize("place", [0, *(pytest.param(each, marks=NIGHTLY) for each in range(1, 5))])
@pytest.mark.parametrize("topic", V2X)
def test_mutated_fields_of_radio_messages_are_handled(
    clean: Path, tmp_path: Path, topic: str, place: int
) -> None:
    mutations = list(mutations_of(BagReader(clean), topic))
    try_all(clean, tmp_path, mutations[place :: len(mutations) // 4], ("verify", "export", "cam", "gnss"))


@NIGHTLY
@pytest.mark.parametrize("topic", V2X)
def test_every_mutated_field_of_radio_messages_is_handled(clean: Path, tmp_path: Path, topic: str) -> None:
    try_all(clean, tmp_path, list(mutations_of(BagReader(clean), topic)), ON_THE_AIR)


@NIGHTLY
@pytest.mark.parametrize("topic", SENSED)
def test_mutated_fields_of_sensor_messages_are_handled(clean: Path, tmp_path: Path, topic: str) -> None:
    try_all(clean, tmp_path, list(mutations_of(BagReader(clean), topic))[::3], ON_BOARD)


@pytest.mark.parametrize("name", some(("no rotation", "shifted", "none", "cut"), "no rotation", "none"))
@pytest.mark.parametrize("topic", ["/ego/odometry", "/ego/ground_truth/odometry", "/tf_static"])
def test_mutated_poses_are_handled(clean: Path, tmp_path: Path, topic: str, name: str) -> None:
    try_all(clean, tmp_path, [Mutation(topic, name, WHOLE[name])], ("verify", "gnss", "evaluate alone"))

"""What once broke advpipe and was mended stays so; of what is not mended yet, the table says who does it."""

from __future__ import annotations

import pytest

from tests.fuzz import base
from tests.fuzz.findings import Finding, all_of
from tests.fuzz.seeds import SEEDS
from tests.fuzz.watch import Limits, Watch
from tests.fuzz.worker import SEEDS as REPLAY_SEEDS
from tests.fuzz.worker import Folder

PENDING = frozenset(
    {
        "deep scenario, replay",
        "deep scenario, cam",
        "deep scenario, gnss",
        "infinite seed",
        "negative seed",
        "deep statistics",
        "statistics of no kind, inspect",
        "statistics of no kind, plot",
        "deep buildings",
        "buildings of no kind",
        "deep parameters",
        "escape in a topic's name",
        "escape in provenance",
        "script in provenance",
        "mathtext in a name",
        "no rotation, replay",
        "no rotation, export",
        "no rotation, cam",
        "stations twice, export",
        "position of no number, cam",
        "position of no number, export",
        "a stranger's message, cam",
        "a stranger's message, export",
        "estimates twice, gnss",
        "aliases in a scenario",
        "tag of another kind",
        "timestamp of no time",
        "tag in a setting",
        "alias of itself",
        "tag in a parameter",
        "many trajectories",
        "many messages, verify",
        "many messages, export",
        "many points, verify",
        "zip of zeros",
        "checkpoint of a deep text",
        "QoS of no kind, recover",
        "name of 300 letters",
        "lane beyond all numbers",
        "lane with and without height",
    }
)
"""Faults that are known and not mended yet. Whoever mends one takes it out: the test insists."""


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Finding]:
    """All seeds in one process, within the limits of the nightly run; what is not handled, by name."""
    out = tmp_path_factory.mktemp("seeds")
    base.build(out / "base")
    folder = Folder(out / "work" / REPLAY_SEEDS)
    folder.path.mkdir(parents=True)
    progress = Watch(
        REPLAY_SEEDS, engine=REPLAY_SEEDS, seed=0, folder=folder, limits=Limits(), inputs=len(SEEDS)
    ).run()
    assert progress.inputs == len(SEEDS)
    return {finding.target: finding for finding in all_of(folder.findings)}


@pytest.mark.parametrize("name", [seed.name for seed in SEEDS])
def test_it_is_handled(name: str, found: dict[str, Finding], request: pytest.FixtureRequest) -> None:
    if name in PENDING:
        request.applymarker(pytest.mark.xfail(strict=True, reason="not mended yet"))
    assert name not in found, f"{found[name]}\n{found[name].fault.trace}"


def test_names_are_unique() -> None:
    assert len({seed.name for seed in SEEDS}) == len(SEEDS)

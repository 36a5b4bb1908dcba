"""One scenario under many seeds: each drive is a job, in a process of this machine or on a cluster."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from advpipe.pipeline.campaigns.run import has_drive
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.jobs import stream_jobs
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.scenario import Scenario
from advpipe.stages.simulate.run import SimulationSummary, simulate

MOST_SEEDS_OF_DRIVES = 10_000
_RANGE = re.compile(r"(?P<first>[0-9]{1,18})(?:-(?P<last>[0-9]{1,18}))?", re.ASCII)


@dataclass(frozen=True)
class SeededDrive:
    """A data set, recorded now (`summary`) or kept."""

    folder: Path
    seed: int
    summary: SimulationSummary | None


def parse_seeds(text: str) -> tuple[int, ...]:
    """The seeds of a list such as `1-20,25`, each once. Raises UsageError for another text.

    >>> parse_seeds("1-3,7")
    (1, 2, 3, 7)
    """
    seeds: dict[int, None] = {}
    for part in text.split(","):
        found = _RANGE.fullmatch(part.strip())
        first, last = (int(found["first"]), int(found["last"] or found["first"])) if found else (1, 0)
        if first > last:
            raise UsageError(
                f"{option_name('seeds')} {short_repr(text)}: write numbers and ranges, such as 1-20,25"
            )
        if last - first >= MOST_SEEDS_OF_DRIVES or len(seeds) + last - first >= MOST_SEEDS_OF_DRIVES:
            raise UsageError(f"{option_name('seeds')}: more than {MOST_SEEDS_OF_DRIVES} drives; give fewer")
        seeds |= dict.fromkeys(range(first, last + 1))
    return tuple(seeds)


def simulate_seeds(
    scenario: Scenario,
    seeds: Sequence[int],
    out: Path,
    *,
    overwrite: bool = False,
    workers: int | None = None,
) -> list[SeededDrive]:
    """Record the drive of each seed as the data set `<out>-seed<N>`; drives that are there are kept.

    The bytes of each are those of `simulate` with that seed. Workers of a cluster write the data sets
    themselves, so they must see the folder of `out`. Raises UsageError for a folder that holds another drive,
    unless `overwrite`.
    """
    scenarios = [_with_seed(scenario, seed) for seed in seeds]
    folders = [out.with_name(f"{out.name}-seed{seed}") for seed in seeds]
    missing = [
        place
        for place, (each, folder) in enumerate(zip(scenarios, folders, strict=True))
        if not has_drive(folder, each, overwrite)
    ]
    for place in missing:
        if folders[place].exists() and not overwrite:
            raise UsageError(
                f"{folders[place]} exists and holds no drive; remove it, or pass "
                f"{option_name('overwrite', True)} to replace it"
            )
    recording = partial(_drive_recorder, scenarios, [str(folder.absolute()) for folder in folders], overwrite)
    recorded = stream_jobs(
        recording, missing, "recording drives", workers, jobs_per_worker=1, writes=out.parent
    )
    summaries = {place: replace(summary, bag=folders[place] / "clean") for place, summary in recorded}
    return [
        SeededDrive(folder, seed, summaries.get(place))
        for place, (folder, seed) in enumerate(zip(folders, seeds, strict=True))
    ]


def _with_seed(scenario: Scenario, seed: int) -> Scenario:
    simulation = scenario.simulation.model_copy(update={"seed": seed})
    return scenario.model_copy(update={"simulation": simulation})


def _drive_recorder(
    scenarios: Sequence[Scenario], folders: Sequence[str], overwrite: bool
) -> Callable[[int], SimulationSummary]:
    """What a worker does: record one of the drives. folders: as text, since they do not travel."""

    def record(place: int) -> SimulationSummary:
        return simulate(scenarios[place], Path(folders[place]), overwrite=overwrite)

    return record

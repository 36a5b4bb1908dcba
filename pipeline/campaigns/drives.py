"""Drives of several scenarios and seeds: each is a job, in a process of this machine or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from advpipe.pipeline.campaigns.run import has_drive
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.jobs import stream_jobs
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.scenario import Scenario
from advpipe.stages.simulate.run import SimulationSummary, simulate


@dataclass(frozen=True)
class PlannedDrive:
    """A scenario, and the data set that it is to become."""

    folder: Path
    scenario: Scenario


@dataclass(frozen=True)
class RecordedDrive:
    """A data set, recorded now (`summary`) or kept."""

    folder: Path
    seed: int
    summary: SimulationSummary | None


def planned_drives(
    scenarios: Sequence[Scenario], seeds: Sequence[int] | None, folder_of: Callable[[Scenario], Path]
) -> list[PlannedDrive]:
    """A drive of each scenario under each seed, as the data set `<folder>-seed<N>`; without seeds, under its
    own and as `<folder>`. Raises UsageError for two scenarios with one folder."""
    folders = [folder_of(scenario) for scenario in scenarios]
    if twice := sorted({folder.name for folder in folders if folders.count(folder) > 1}):
        raise UsageError(
            f"several scenarios have the name {twice[0]}, and would be one data set; rename them"
        )
    if seeds is None:
        return [PlannedDrive(*each) for each in zip(folders, scenarios, strict=True)]
    return [
        PlannedDrive(folder.with_name(f"{folder.name}-seed{seed}"), _with_seed(scenario, seed))
        for folder, scenario in zip(folders, scenarios, strict=True)
        for seed in seeds
    ]


def simulate_drives(
    drives: Sequence[PlannedDrive], *, overwrite: bool = False, workers: int | None = None
) -> list[RecordedDrive]:
    """Record the drives in one folder; those that are there are kept.

    The bytes of each are those of `simulate`. Workers of a cluster write the data sets themselves, so they
    must see the folder. Raises UsageError for a data set that holds another drive, unless `overwrite`.
    """
    missing = [
        place for place, drive in enumerate(drives) if not has_drive(drive.folder, drive.scenario, overwrite)
    ]
    for folder in (drives[place].folder for place in missing):
        if folder.exists() and not overwrite:
            raise UsageError(
                f"{folder} exists and holds no drive; remove it, or pass "
                f"{option_name('overwrite', True)} to replace it"
            )
    texts = [str(drive.folder.absolute()) for drive in drives]
    recording = partial(_drive_recorder, [drive.scenario for drive in drives], texts, overwrite)
    recorded = stream_jobs(
        recording,
        missing,
        "recording drives",
        workers,
        jobs_per_worker=1,
        writes=drives[0].folder.parent,
    )
    summaries = {place: replace(summary, bag=drives[place].folder / "clean") for place, summary in recorded}
    return [
        RecordedDrive(drive.folder, drive.scenario.simulation.seed, summaries.get(place))
        for place, drive in enumerate(drives)
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

"""Stage 1 as a function."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.commands.paths import DATA_SETS, PathLike, refuse_existing
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.process.folder import working_path
from advpipe.pipeline.scenario import Scenario, load_scenario

if TYPE_CHECKING:
    from advpipe.pipeline.scenario.attacks import AttackSpec
    from advpipe.stages.simulate.run import SimulationSummary


@with_progress("simulating {scenario}")
def simulate(
    scenario: PathLike | Scenario = "district",
    *,
    settings: Mapping[str, object] | Sequence[str] = (),
    out: PathLike | None = None,
    live: str | None = None,
    overwrite: bool = False,
) -> SimulationSummary:
    """Stage 1: record a clean drive (LiDAR, ground truth, odometry, GNSS, V2X) to an MCAP bag.

    scenario: a shipped name, a scenario file, or what `load_scenario` gave. settings: keys of the scenario to
    override, as a mapping from `section.key` to a value or as texts `section.key=value`; not with a scenario
    that is loaded already. out: the data set's folder, `datasets/<name>` by default. live: also publishes
    the drive while it is recorded, at most in real time: `ros2` or `foxglove`. overwrite: replaces a folder
    that exists.

    Returns what was recorded; as a path it stands for the clean bag. Raises UsageError for a scenario or a
    setting that is none and for an output that exists.

    >>> drive = advpipe.simulate("smoke", settings={"simulation.duration_s": 2})
    >>> drive.bag
    PosixPath('datasets/smoke/clean')
    """
    if isinstance(scenario, Scenario):
        if settings:
            raise UsageError("settings: the scenario is already loaded; pass them to load_scenario")
        loaded, named = scenario, scenario.name
    else:
        named = str(Path(scenario))
        with as_usage_error():
            loaded = load_scenario(named, settings, _mistakes_of_attacks)
    detail(f"scenario {loaded.name} of {named}, seed {loaded.simulation.seed}")
    folder = working_path(DATA_SETS) / loaded.name if out is None else Path(out)
    refuse_existing(folder, overwrite)
    with working_on("loading libraries"):
        from advpipe.pipeline.bag.lidar_notice import notice_default_lidar
        from advpipe.pipeline.bag.reader import BagReader
        from advpipe.stages.simulate.run import simulate as run

    recorded = run(loaded, folder, overwrite=overwrite, live=live)
    notice_default_lidar(BagReader(recorded.bag))
    return recorded


def _mistakes_of_attacks(
    attacks: Sequence[AttackSpec], scenario: Scenario | None
) -> Iterable[tuple[int | None, str]]:
    """As `run` asks for them, except that a drive may be recorded without the V2X that its attacks need.

    The attacks are loaded only if the scenario has some.
    """
    with working_on("loading libraries"):
        from advpipe.pipeline.campaigns.run import mistakes_of_attacks

    return mistakes_of_attacks(attacks, None)

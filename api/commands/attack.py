"""Stage 2 as a function."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from advpipe.commands.attackers import attackers_section
from advpipe.commands.paths import PathLike, bag_or_newest, default_output, refuse_existing
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.errors import UsageError, as_usage_error, writing
from advpipe.pipeline.core.progress import with_progress, working_on
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.process.folder import refuse_undecodable

if TYPE_CHECKING:
    from advpipe.stages.attack.run import AttackSummary


@with_progress("attacking {bag} with {type}")
def attack(
    bag: PathLike | None = None,
    *,
    type: str = AttackOptions.type,
    recipe: str | None = AttackOptions.recipe,
    attacker: str | Sequence[str] = (),
    victim: str | None = AttackOptions.victim,
    dcc_reacts: bool = AttackOptions.dcc_reacts,
    credentials: str = AttackOptions.credentials,
    network: str = AttackOptions.network,
    from_s: float = AttackOptions.from_s,
    to_s: float | None = AttackOptions.to_s,
    lidar: str | None = AttackOptions.lidar,
    frames: str = AttackOptions.frames,
    detector: str = AttackOptions.detector,
    device: str = "cpu",
    lidar_height_m: float | None = AttackOptions.lidar_height_m,
    level: bool = AttackOptions.level,
    scale_intensity: float = AttackOptions.scale_intensity,
    seed: int = AttackOptions.seed,
    workers: int | None = None,
    cluster: str | None = None,
    debug: bool = AttackOptions.debug,
    out: PathLike | None = None,
    overwrite: bool = False,
    parameters: Mapping[str, Any] | None = None,
    **more_parameters: Any,
) -> AttackSummary:
    """Stage 2: write an adversarial version of a bag; everything not attacked is copied byte for byte.

    bag: a data set, a rosbag2 folder, an .mcap file or the result of `simulate`; by default the newest data
    set under `datasets`. type: `detach`, `perturb`, `attach`, `cam-...`, `gnss-...`, `camera-...`,
    `radar-...`, or `module:Class` of your own. recipe, of LiDAR attacks: `best`, `hide`, `robust`,
    `stealthy`, `transfer`, `paper`, a black box: `score-based`, `decision-based`, or a random baseline:
    `random`, `random-near`, `random-best`. attacker, of V2X attacks: a vehicle's id or several, `20%`, or
    `rsu:X,Y` in metres. victim: the vehicle whose sensors are attacked, or
    that false CAMs target. dcc_reacts: whether other stations' congestion control drops CAMs when an attack
    fills the channel. credentials: what V2X attackers sign with where the drive is signed: `ticket`, or as
    outsiders `none`, `untrusted`, `expired` or `stolen`. network: whose radio sends the messages of V2X and
    GPS attacks, `embedded` or `artery`. from_s, to_s: when, in seconds of the recording.
    lidar: the topic of the clouds, among several. frames: `start:stop:step`, which clouds the bag then holds.
    detector: a shipped name, a .safetensors file, or `module:Class`; several joined by commas are an
    ensemble. device: where it computes, `cpu`, `cuda` or `cuda:N`. lidar_height_m, level, scale_intensity:
    how it is shown clouds, see `evaluate`; the ground is fitted in each clean cloud. seed: of the attack's
    own draws. workers: processes, by default one a core; their number changes no byte. cluster: the address
    of a Ray cluster that does the work, or `auto`. debug: whether the bag gets topics under `/advpipe/debug`,
    which show viewers what was attacked. out: the bag's folder, by default in the clean one's data set, or
    beside it as `BAG-...`. overwrite: replaces one that exists.

    The attack's parameters are given by name, such as `ratio` (the share of points to remove) of `detach`,
    `eps_cm` of `perturb`, `points` and `eps_m` of `attach`, `goal` ("break" or "hide"); `parameters` takes
    those of an attack of your own that have the name of an option here.

    Returns what was done; as a path it stands for the adversarial bag. Raises UsageError for what cannot be
    carried out as it is given, and AdvpipeError for what fails on the way.

    >>> drive = advpipe.simulate("smoke")
    >>> detached = advpipe.attack(drive, type="detach", ratio=0.01)
    >>> stopped = advpipe.attack(drive, type="cam-speed-constant", attacker="20%", speed_mps=0.0)
    """
    if out is not None:
        refuse_existing(Path(out), overwrite)  # before torch is loaded
    with as_usage_error():
        clean = bag_or_newest(bag)
    with working_on("loading libraries"):
        from advpipe.pipeline.bag.reader import BagReader
        from advpipe.pipeline.cluster.connect import use_cluster
        from advpipe.pipeline.scenario.attacks import attack_spec
        from advpipe.stages.attack.output_name import output_name
        from advpipe.stages.attack.registry import default_budget
        from advpipe.stages.attack.run import AttackRequest
        from advpipe.stages.attack.run import attack as run

    with as_usage_error():
        spec = attack_spec(
            {
                "type": type,
                "recipe": recipe,
                "parameters": {**default_budget(type), **_merged(parameters or {}, more_parameters)},
                "schedule": {"from_s": from_s, "to_s": to_s},
                "attackers": attackers_section([attacker] if isinstance(attacker, str) else attacker),
                "victim": victim,
                "dcc_reacts": dcc_reacts,
                "credentials": credentials,
                "network": network,
                "lidar": lidar,
                "frames": frames,
                "detector": detector,
                "lidar_height_m": lidar_height_m,
                "level": level,
                "scale_intensity": scale_intensity,
            }
        )
        request = AttackRequest((spec,), seed, device, debug)
        request.check()
    name = output_name(request, BagReader(clean))
    target = default_output(clean, name) if out is None else Path(out)
    refuse_existing(target, overwrite)
    refuse_undecodable(target)
    detail(f"{name} of {clean}, seed {seed}, detector {detector} on {device}")
    with writing(target), use_cluster(cluster, device):
        return run(clean, target, request, overwrite=overwrite, workers=workers)


def _merged(parameters: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    if twice := sorted(parameters.keys() & more.keys()):
        raise UsageError(f"the parameter {short_repr(twice[0])} is given twice; give it once")
    return {**parameters, **more}

"""The command of stage 2."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from advpipe.pipeline.cli.completion import attack_names, detector_names, recipe_names
from advpipe.pipeline.cli.shared import (
    Answer,
    Cluster,
    Device,
    Level,
    LidarHeight,
    LidarTopic,
    Overwrite,
    ScaleIntensity,
    Workers,
    cli_option,
    print_line,
    typed,
)
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.progress import with_progress

if TYPE_CHECKING:
    from advpipe.stages.attack.run import AttackSummary


@with_progress("attacking {bag} with {type}")
def attack_command(
    bag: Annotated[
        Path | None, typer.Argument(help="Data set, rosbag2 folder or .mcap.", show_default="newest data set")
    ] = None,
    type: Annotated[
        str, cli_option(AttackOptions, "type", "--type", autocompletion=attack_names)
    ] = AttackOptions.type,
    recipe: Annotated[
        str | None, cli_option(AttackOptions, "recipe", show_default="best", autocompletion=recipe_names)
    ] = AttackOptions.recipe,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="A parameter of the attack: name=value; repeatable.")
    ] = None,
    attacker: Annotated[
        list[str] | None,
        typer.Option(
            help=("V2X attacker: a vehicle's id (repeatable), 20% of all stations, or rsu:X,Y in metres.")
        ),
    ] = None,
    victim: Annotated[str | None, cli_option(AttackOptions, "victim")] = AttackOptions.victim,
    dcc_reacts: Annotated[
        bool, cli_option(AttackOptions, "dcc_reacts", "--dcc-reacts")
    ] = AttackOptions.dcc_reacts,
    credentials: Annotated[str, cli_option(AttackOptions, "credentials")] = AttackOptions.credentials,
    network: Annotated[str, cli_option(AttackOptions, "network")] = AttackOptions.network,
    from_s: Annotated[float, cli_option(AttackOptions, "from_s", "--from")] = AttackOptions.from_s,
    to_s: Annotated[
        float | None, cli_option(AttackOptions, "to_s", "--to", show_default="of the recording")
    ] = AttackOptions.to_s,
    lidar: LidarTopic = AttackOptions.lidar,
    frames: Annotated[str, cli_option(AttackOptions, "frames")] = AttackOptions.frames,
    detector: Annotated[
        str, cli_option(AttackOptions, "detector", autocompletion=detector_names)
    ] = AttackOptions.detector,
    device: Device = AttackOptions.device,
    lidar_height_m: LidarHeight = None,
    level: Level = False,
    scale_intensity: ScaleIntensity = AttackOptions.scale_intensity,
    seed: Annotated[int, cli_option(AttackOptions, "seed")] = AttackOptions.seed,
    workers: Workers = None,
    cluster: Cluster = None,
    debug: Annotated[bool, cli_option(AttackOptions, "debug", "--debug/--no-debug")] = AttackOptions.debug,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Adversarial bag.", show_default="beside the clean one")
    ] = None,
    overwrite: Overwrite = False,
    **more_parameters: Any,
) -> Answer:
    """Stage 2: write an adversarial version of a bag; everything not attacked is copied byte for byte.

    The parameters of the attack are options, too, such as --ratio of detach; with --type, this help explains
    them. A LiDAR attack knows the detector, the true boxes and the rule that matches detections to them.
    """
    from advpipe.commands.attack import attack as run

    given = {name: value for name, value in more_parameters.items() if value is not None}
    summary = run(
        bag,
        type=type,
        recipe=recipe,
        attacker=attacker or (),
        victim=victim,
        dcc_reacts=dcc_reacts,
        credentials=credentials,
        network=network,
        from_s=from_s,
        to_s=to_s,
        lidar=lidar,
        frames=frames,
        detector=detector,
        device=device,
        lidar_height_m=lidar_height_m,
        level=level,
        scale_intensity=scale_intensity,
        seed=seed,
        workers=workers,
        cluster=cluster,
        debug=debug,
        out=out,
        overwrite=overwrite,
        parameters=given_parameters(given, settings or []),
    )
    adaptation = _adaptation_words(lidar_height_m, level, scale_intensity)
    return attacked(summary, [_evaluation(bag, summary.bag, detector, adaptation)])


def attacked(summary: AttackSummary, next_commands: Sequence[str] = ()) -> Answer:
    """The bag, and what was done to it: of the losses their means."""
    before, after = summary.mean_losses
    document = {key: value for key, value in vars(summary).items() if key != "losses"}
    document |= {"mean_loss_before": before, "mean_loss_after": after, "warnings": summary.warnings}
    shown = print_line(str(summary).removeprefix(f"{summary.bag}: "))
    return Answer(document, shown, made={"bag": summary.bag}, next_commands=next_commands)


def _adaptation_words(lidar_height_m: float | None, level: bool, scale_intensity: float) -> list[str]:
    """The options by which the evaluation shows the detector the same clouds as the attack did."""
    height = [] if lidar_height_m is None else ["--lidar-height", repr(lidar_height_m)]
    is_scaled = scale_intensity != AttackOptions.scale_intensity
    scale = ["--scale-intensity", repr(scale_intensity)] if is_scaled else []
    return [*height, *(["--level"] if level else []), *scale]


def _evaluation(clean: Path | None, adversarial: Path, detector: str, adaptation: Sequence[str]) -> str:
    """The command that evaluates the bag: of a data set all of its attacks, again where there is a report."""
    from advpipe.commands.paths import bag_or_newest, default_output
    from advpipe.pipeline.bag.locate import CLEAN_NAME
    from advpipe.pipeline.detector.registry import detector_slug, member_names

    bag = bag_or_newest(clean)
    names = member_names(detector)
    folder, report = bag.parent, default_output(bag, "+".join(map(detector_slug, names)), "reports")
    is_in_set = bag.name == CLEAN_NAME and adversarial.parent.resolve() == folder.resolve()
    is_usual = detector == AttackOptions.detector
    chosen = [] if is_usual else [word for name in names for word in ("--detector", name)]
    again = ["--overwrite"] if report.exists() else []
    return typed("evaluate", *([folder] if is_in_set else [bag, adversarial]), *chosen, *adaptation, *again)


def given_parameters(options: dict[str, Any], settings: list[str]) -> dict[str, Any]:
    """Those given as options, and the values of `name=value`, each read as YAML."""
    from advpipe.pipeline.core.errors import UsageError
    from advpipe.pipeline.core.short_repr import short_repr, shorten

    found = dict(options)
    for setting in settings:
        given, equals, text = setting.partition("=")
        name = given.strip().replace("-", "_")
        if not equals or not name:
            raise UsageError(f"--set {short_repr(setting)}: write name=value, such as rounds=20")
        if name in found:
            raise UsageError(
                f"--set {short_repr(setting)}: {shorten(name)} is already {short_repr(found[name])}; "
                "give it once"
            )
        found[name] = read_value(text, f"--set {short_repr(setting)}")
    return found


def read_value(text: str, where: str) -> Any:
    """A value as the command line has it, read as YAML. Raises UsageError, which begins with `where`."""
    from advpipe.pipeline.core.errors import UsageError
    from advpipe.pipeline.scenario.document import DocumentError, read_document

    try:
        return read_document(text).tree
    except DocumentError as error:
        raise UsageError(f"{where}: the value cannot be read: {error}") from None

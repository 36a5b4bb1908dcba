"""The command line: the one module here that knows the stages; each is imported inside its command."""

from __future__ import annotations

import math
import os
import select
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    from advpipe.stages.train.run import TrainSummary


class _OneLineErrors(TyperGroup):
    """A user's mistake becomes one line and a non-zero exit code."""

    def invoke(self, ctx: typer.Context) -> object:  # type: ignore[override]
        from advpipe.pipeline.errors import AdvpipeError, os_error_line

        try:
            result = super().invoke(ctx)
            sys.stdout.flush()
            return result
        except AdvpipeError as error:
            print(f"advpipe: {' '.join(str(error).split())}", file=sys.stderr)
            raise typer.Exit(error.exit_code) from None
        except OSError as error:
            if not (isinstance(error, BrokenPipeError) and _is_unread(sys.stdout)):
                print(f"advpipe: {' '.join(os_error_line(error).split())}", file=sys.stderr)
            raise typer.Exit(1) from None
        except KeyboardInterrupt:
            print("advpipe: interrupted", file=sys.stderr)
            raise typer.Exit(130) from None


def _is_unread(stream: TextIO) -> bool:
    """Whether the reader is gone, as after `| head`; what is still to be written then goes nowhere."""
    poll = select.poll()
    poll.register(stream, 0)  # errors alone are reported
    if not poll.poll(0):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return True


app = typer.Typer(
    cls=_OneLineErrors,
    name="advpipe",
    help="Adversarial attacks on autonomous vehicles: simulate a drive, attack it, measure the damage.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace an output that exists.")]
DetectorName = Annotated[
    str, typer.Option("--detector", help="A shipped name, a .safetensors file, or module:Class.")
]


@app.command()
def simulate(
    scenario: Annotated[str, typer.Argument(help="A scenario file or a shipped name.")] = "boulevard",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Data set folder.", show_default="datasets/<name>")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Override one key: section.key=value.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Stage 1: record a clean drive (LiDAR, ground truth, odometry, GNSS) to an MCAP bag."""
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.stages.simulate.run import simulate as run

    loaded = load_scenario(scenario, settings or ())
    summary = run(loaded, out or Path("datasets") / loaded.name, overwrite=overwrite)
    print(
        f"{summary.bag}: {summary.frames} frames, "
        f"{summary.clouds} clouds of {summary.points / max(summary.clouds, 1):,.0f} points, "
        f"{summary.road_users} road users in range"
    )
    for name, value in summary.v2x.lines() if summary.v2x else ():
        print(f"{name}: {value}")


@app.command()
def attack(
    bag: Annotated[
        Path | None, typer.Argument(help="Data set, rosbag2 folder or .mcap.", show_default="newest data set")
    ] = None,
    kind: Annotated[str, typer.Option("--type", help="Which attack: detach.")] = "detach",
    ratio: Annotated[float, typer.Option(help="Share of the points to remove (detach).")] = 0.01,
    recipe: Annotated[
        str, typer.Option(help="best, paper (as published) or random (the baseline).")
    ] = "best",
    frames: Annotated[str, typer.Option(help="start:stop:step; the bag then holds only these.")] = "::",
    detector: DetectorName = "small",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the attack's own draws.")] = 0,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="one a core")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Adversarial bag.", show_default="beside the clean one")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Stage 2: write an adversarial version of a bag; everything not attacked is copied byte for byte."""
    from advpipe.pipeline.bag.frames import FrameSlice
    from advpipe.pipeline.bag.locate import newest_dataset, resolve_bag
    from advpipe.pipeline.errors import writing
    from advpipe.stages.attack.run import AttackRequest, attack_id
    from advpipe.stages.attack.run import attack as run

    clean = resolve_bag(bag or newest_dataset(Path("datasets")))
    request = AttackRequest(
        type=kind,
        recipe=recipe,
        parameters={"ratio": ratio},
        detector=detector,
        frames=FrameSlice.parse(frames),
        seed=seed,
    )
    target = out or clean.parent / attack_id(request)
    with writing(target):
        print(run(clean, target, request, overwrite=overwrite, workers=workers))


@app.command()
def evaluate(
    bags: Annotated[
        list[Path] | None,
        typer.Argument(
            help="Clean bag, then adversarial ones.", show_default="newest data set, all its attacks"
        ),
    ] = None,
    detector: DetectorName = "small",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the bootstrap and of the random baseline.")] = 0,
    baseline: Annotated[bool, typer.Option(help="Score the same budget spent at random.")] = True,
    lidar: Annotated[
        str | None, typer.Option(help="Topic of the clouds, such as /ego/lidar/points, among several.")
    ] = None,
    write_detections: Annotated[
        bool, typer.Option("--write-detections", help="Also write bags that show the detections.")
    ] = False,
    with_clouds: Annotated[
        bool, typer.Option("--with-clouds", help="Keep the clouds in those bags (implies them).")
    ] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes.", show_default="one a core")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Report folder.", show_default="reports/ of the data set"),
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Stage 3: run a detector on clean and adversarial bags; AP, mAP ratio, Chamfer distance, report."""
    from advpipe.pipeline.bag.locate import adversarial_bags, newest_dataset, resolve_bag
    from advpipe.stages.evaluate.run import evaluate as run
    from advpipe.stages.evaluate.run import print_report

    given = bags or [newest_dataset(Path("datasets"))]
    clean = resolve_bag(given[0])
    adversarial = [resolve_bag(bag) for bag in given[1:]]
    if len(given) == 1 and clean.name == "clean":
        adversarial = adversarial_bags(clean.parent)
    target = out or clean.parent / "reports" / detector_slug(detector)
    report = run(
        clean,
        adversarial,
        target,
        detector=detector,
        seed=seed,
        baseline=baseline,
        overwrite=overwrite,
        lidar_topic=lidar,
        workers=workers,
        detections=write_detections or with_clouds,
        with_clouds=with_clouds,
    )
    print_report(report)
    print(f"report: {target / 'report.html'}")


def detector_slug(detector: str) -> str:
    """A detector's name as the name of a folder: `small`, `my-model`, `package.module-Class`."""
    return Path(detector).stem if detector.endswith(".safetensors") else detector.replace(":", "-")


@app.command()
def train(
    bags: Annotated[list[Path], typer.Argument(help="Clean bags to learn from.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the checkpoint, log and plot.")],
    preset: Annotated[str, typer.Option(help="Size of the SECOND detector.")] = "small",
    steps: Annotated[int, typer.Option(min=1, help="Optimiser steps, two frames each.")] = 3000,
    start: Annotated[Path | None, typer.Option("--start", help="Go on from this checkpoint.")] = None,
    learning_rate: Annotated[float, typer.Option(help="Peak rate, after the warm-up.")] = 3e-3,
    validate: Annotated[Path | None, typer.Option("--validate", help="A held-out bag to score.")] = None,
    bf16: Annotated[bool, typer.Option("--bf16", help="Half the time where the processor has it.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of weights, order and augmentation.")] = 0,
    overwrite: Overwrite = False,
) -> None:
    """Train a SECOND detector on clean bags; goes on where an interrupted run stopped."""
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.errors import AdvpipeError, writing
    from advpipe.stages.train.config import TrainConfig
    from advpipe.stages.train.run import train as run

    if not 0 < learning_rate < math.inf:
        raise AdvpipeError(f"--learning-rate is {learning_rate:g}; it has to be finite and above 0")
    config = TrainConfig(
        bags=tuple(resolve_bag(bag) for bag in bags),
        out=out,
        preset=preset,
        start=start,
        steps=steps,
        learning_rate=learning_rate,
        validation=resolve_bag(validate) if validate else None,
        bf16=bf16,
        seed=seed,
    )
    with writing(out):
        print(_trained(run(config, overwrite=overwrite)))


def _trained(summary: TrainSummary) -> str:
    """The checkpoint, what it learnt from, and the average precision of the classes validated."""
    found = ", ".join(
        f"{name} {precision.strict_percent:.1f} %"
        for name, precision in summary.precision.items()
        if precision.boxes
    )
    return f"{summary.checkpoint}: {summary.steps} steps on {summary.frames} frames" + (
        f"; 3D AP on the held-out bag: {found}" if found else ""
    )


@app.command("import-weights")
def import_weights(
    file: Annotated[Path, typer.Argument(help="Checkpoint (.pth) of OpenPCDet's SECOND for KITTI.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The .safetensors file to write.")],
    overwrite: Overwrite = False,
) -> None:
    """Turn a SECOND that OpenPCDet trained into a detector for --detector; runs no code from the file."""
    from advpipe.pipeline.detector.second.checkpoint import save_checkpoint
    from advpipe.pipeline.detector.second.openpcdet import import_openpcdet
    from advpipe.pipeline.errors import AdvpipeError, OutputExistsError

    if out.suffix != ".safetensors":
        raise AdvpipeError(f"--out is {out}; a detector's file is named .safetensors")
    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    net, provenance = import_openpcdet(file)
    save_checkpoint(net, out, provenance, half=False, overwrite=overwrite)
    parameters = sum(weight.numel() for weight in net.parameters())
    print(f"{out}: preset {net.preset.name}, {parameters:,} parameters; use it as --detector {out}")


@app.command()
def inspect(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap.")],
    as_json: Annotated[bool, typer.Option("--json", help="For programs.")] = False,
) -> None:
    """What is in a bag: topics, rates, clouds, road users, V2X, provenance, checksums."""
    from advpipe.pipeline.bag.inspect import describe

    description = describe(bag)
    if as_json:
        print(description.to_json())
    else:
        description.print()


@app.command()
def plot(
    bag: Annotated[Path, typer.Argument(help="Data set, rosbag2 folder or .mcap.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Picture to write: .png, .pdf or .svg.")] = Path(
        "v2x.png"
    ),
    overwrite: Overwrite = False,
) -> None:
    """Draw a drive's V2X: CAM rates, packets delivered by distance, channel load."""
    from advpipe.pipeline.bag.v2x_picture import draw_bag

    draw_bag(bag, out, overwrite)
    print(out)


@app.command()
def recover(
    path: Annotated[
        Path, typer.Argument(help="What a killed run was to make, or a damaged data set, bag or .mcap.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Where to.", show_default="PATH-recovered")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Save what was written of a recording that was cut off, as a whole bag or data set beside it.

    What a killed run wrote stays in a hidden folder until a later run for the same output has finished.
    """
    from advpipe.pipeline.bag.recover import recover as run

    print(run(path, out, overwrite=overwrite))


@app.command()
def schema(
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write.", show_default="standard output")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """The JSON Schema of scenario files, for editors and checkers.

    Editors with a YAML language server complete and check a scenario that starts with the line
    `# yaml-language-server: $schema=FILE`.
    """
    from advpipe.pipeline.scenario.schema import schema_json, write_schema

    if out is None:
        print(schema_json())
    else:
        write_schema(out, overwrite)
        print(out)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"advpipe {version('advpipe')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


if __name__ == "__main__":
    app()

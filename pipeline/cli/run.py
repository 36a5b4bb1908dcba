"""The command that goes through all stages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from advpipe.pipeline.cli.attack import attacked
from advpipe.pipeline.cli.evaluate import detector_slug, evaluate
from advpipe.pipeline.cli.shared import Answer, DetectorName, Device, Overwrite, Workers, line, show_part
from advpipe.pipeline.cli.simulate import simulate

if TYPE_CHECKING:
    from advpipe.pipeline.scenario import Scenario
    from advpipe.stages.attack.run import AttackRequest


def run(
    scenario: Annotated[str, typer.Argument(help="A scenario file or a shipped name.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Data set folder.", show_default="datasets/<name>")
    ] = None,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Override one key: section.key=value.")
    ] = None,
    detector: DetectorName = "small",
    device: Device = "cpu",
    workers: Workers = None,
    overwrite: Overwrite = False,
) -> Answer:
    """All stages: simulate a scenario, carry out its attacks, evaluate; goes on where it was stopped.

    What is done already is kept. A drive, bag or report in its place that comes of anything else is
    refused, or replaced with --overwrite.
    """
    from advpipe.pipeline.core.errors import wrong_use
    from advpipe.pipeline.process.folder import here, refuse_undecodable
    from advpipe.pipeline.scenario import load_scenario
    from advpipe.stages.attack.run import AttackRequest

    with wrong_use():
        loaded = load_scenario(scenario, settings or ())
        requests = {
            name: AttackRequest(attacks, loaded.simulation.seed, device)
            for name, attacks in loaded.attacks.items()
        }
        for name, request in requests.items():  # rather now than after the simulation
            request.check()
            request.refuse_without_v2x(name, loaded)
    folder = out or here("datasets") / loaded.name
    refuse_undecodable(folder)
    if _has_drive(folder, loaded, overwrite):
        drive = show_part(_kept("bag", folder / "clean"))
    else:
        drive = show_part(simulate(scenario, folder, settings, overwrite))
    attacks = [
        show_part(_attack(folder / "clean", folder / name, request, workers, overwrite))
        for name, request in requests.items()
    ]
    bags = [folder / "clean", *(folder / name for name in requests)]
    report = folder / "reports" / detector_slug(detector)
    if _is_report_of(report, bags, detector, device):
        scored = show_part(_kept("report", report))
    else:
        scored = show_part(
            evaluate(bags, [detector], device=device, workers=workers, out=report, overwrite=overwrite)
        )
    document = {"data_set": folder, "drive": drive, "attacks": attacks, "evaluation": scored}
    return Answer(document, lambda: None)


def _kept(kind: str, path: Path) -> Answer:
    """Of a result that is there already."""
    return Answer({kind: path, "kept": True}, line(f"{path}: kept"))


def _has_drive(folder: Path, scenario: Scenario, overwrite: bool) -> bool:
    """Whether a data set holds the drive of this scenario, whatever its attacks."""
    from advpipe.pipeline.core.document import read_text
    from advpipe.pipeline.core.errors import AdvpipeError, UsageError
    from advpipe.pipeline.scenario import dump_scenario

    resolved = folder / "scenario.yaml"
    if not (folder / "clean" / "metadata.yaml").is_file() or not resolved.is_file():
        return False
    try:
        if read_text(resolved) == dump_scenario(scenario):
            return True
    except AdvpipeError:
        if not overwrite:
            raise
    if overwrite:
        return False
    raise UsageError(
        f"{folder} holds the drive of another scenario; pass --overwrite to replace it, or give another --out"
    )


def _attack(clean: Path, bag: Path, request: AttackRequest, workers: int | None, overwrite: bool) -> Answer:
    """Makes the bag, unless the same request made it of the same clean one."""
    from advpipe.pipeline.bag.reader import BagReader
    from advpipe.pipeline.core.errors import UsageError, writing
    from advpipe.stages.attack.provenance import provenance_of, resolved_text
    from advpipe.stages.attack.run import attack

    made = bag / "attack.yaml"
    wanted = resolved_text(provenance_of(BagReader(clean), request))
    if made.is_file():
        others = _differing_keys(made, wanted)
        if not others:
            return _kept("bag", bag)
        if not overwrite:
            raise UsageError(
                f"{bag} was made with other {', '.join(others)} (see {made.name} in it); pass --overwrite to "
                "make it again, or give another --out"
            )
    with writing(bag):
        summary = attack(clean, bag, request, overwrite=overwrite, workers=workers)
    return attacked(summary)


def _differing_keys(made: Path, wanted: str) -> list[str]:
    """The keys at the top of two YAML texts whose values differ; the whole text where one is no mapping."""
    from advpipe.pipeline.core.document import Word, read_text, read_yaml
    from advpipe.pipeline.core.errors import AdvpipeError

    try:
        text = read_text(made)
        if text == wanted:
            return []
        old, new = (read_yaml(each, dict[Word, Any], str(made), "") for each in (text, wanted))
    except AdvpipeError:
        return ["text"]
    return sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key)) or ["text"]


def _is_report_of(report: Path, bags: Sequence[Path], detector: str, device: str) -> bool:
    """Whether a report tells of just these bags, by their checksums, of this detector, device and code."""
    from advpipe.pipeline.bag.provenance import parent_sha256
    from advpipe.pipeline.core.code import code_sha256
    from advpipe.pipeline.core.errors import AdvpipeError
    from advpipe.pipeline.dataset.reports import read_report
    from advpipe.pipeline.detector.registry import detector_sha256
    from advpipe.stages.evaluate.provenance import REPORTING

    try:
        about = read_report(report / "report.json").provenance
    except AdvpipeError:
        return False
    scored = [about.clean.sha256, *(bag.sha256 for bag in about.compared if bag.sha256)]
    detectors = [one.sha256 for one in about.detectors]
    was_here = about.device == device.partition(":")[0]
    was_so = about.code_sha256 == code_sha256(*REPORTING)
    is_of_bags = sorted(scored) == sorted(map(parent_sha256, bags))
    return is_of_bags and detectors in ([], [detector_sha256(detector)]) and was_here and was_so

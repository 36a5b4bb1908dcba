"""All stages of a scenario, one after the other; existing results are kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.locate import adversarial_bags
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.attack_options import AttackOptions
from advpipe.pipeline.core.code import code_sha256
from advpipe.pipeline.core.document import ShortText, read_text, read_yaml
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, writing
from advpipe.pipeline.core.progress import plan_progress, working_on
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.dataset.reports import SweepReportDocument, read_report
from advpipe.pipeline.detector.adaptation import AS_THEY_ARE, Adaptation
from advpipe.pipeline.detector.registry import detector_sha256, detector_slug
from advpipe.pipeline.scenario import Scenario, dump_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.build import adaptation_of
from advpipe.stages.attack.mistakes import mistakes_of_spec
from advpipe.stages.attack.provenance import job_provenance, resolved_text
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.run import AttackRequest, AttackSummary, attack
from advpipe.stages.evaluate.provenance import REPORTING
from advpipe.stages.evaluate.run import Options, Report, evaluate
from advpipe.stages.simulate.run import SimulationSummary, simulate

SIMULATING, EVALUATING = "simulating", "evaluating"
"""The phases of a campaign, beside those named after the bags of its attacks."""


@dataclass(frozen=True)
class Kept:
    """An existing result. kind: `bag` or `report`."""

    kind: str
    path: Path


@dataclass(frozen=True)
class Evaluated:
    """The report that was made, and its folder."""

    report: Report
    folder: Path


Part = Kept | SimulationSummary | AttackSummary | Evaluated
"""The result of a stage, new or existing."""


@dataclass(frozen=True)
class Campaign:
    """A scenario's drive, its attacks and their evaluation, in the folder of a data set.

    requests: by the name of the bag that each makes. An existing result of anything else is refused, or
    replaced with `overwrite`. adaptation: how the evaluation presents clouds to the detector.
    """

    scenario: Scenario
    requests: Mapping[str, AttackRequest]
    folder: Path
    detector: str
    device: str
    workers: int | None = None
    overwrite: bool = False
    adaptation: Adaptation = AS_THEY_ARE

    @classmethod
    def of(
        cls,
        scenario: Scenario,
        folder: Path,
        detector: str,
        device: str,
        *,
        debug: bool = AttackOptions.debug,
        adaptation: Adaptation = AS_THEY_ARE,
        **options: Any,
    ) -> Campaign:
        """debug: whether adversarial bags have debug topics. adaptation: how clouds are presented to
        detectors, also to those of attacks for which the scenario does not say it.

        Raises AdvpipeError for an attack that cannot be carried out, before the simulation;
        `mistakes_of_attacks` finds all of them.
        """
        requests = {
            name: AttackRequest(
                tuple(with_adaptation(spec, adaptation) for spec in attacks),
                scenario.simulation.seed,
                device,
                debug,
            )
            for name, attacks in scenario.attacks.items()
        }
        for name, request in requests.items():
            request.check()
            request.refuse_without_v2x(name, scenario)
        return cls(scenario, requests, folder, detector, device, adaptation=adaptation, **options)

    def run(self) -> Iterator[Part]:
        """Yield the drive, each attack and the report, each as soon as it is finished."""
        clean = self.folder / "clean"
        plan_progress({SIMULATING: 3, **dict.fromkeys(self.requests, 4), EVALUATING: 3 + len(self.requests)})
        yield self._drive(clean)
        for name, request in self.requests.items():
            yield self._attack(clean, self.folder / name, request)
        yield self._report([clean, *(self.folder / name for name in self.requests)])

    def _drive(self, clean: Path) -> Part:
        if has_drive(self.folder, self.scenario, self.overwrite):
            return Kept("bag", clean)
        detail(f"scenario {self.scenario.name}, seed {self.scenario.simulation.seed}")
        with working_on(SIMULATING):
            return simulate(self.scenario, self.folder, overwrite=self.overwrite)

    def _attack(self, clean: Path, bag: Path, request: AttackRequest) -> Part:
        if is_made_by(request, clean, bag, self.overwrite):
            return Kept("bag", bag)
        with working_on(bag.name), writing(bag):
            return attack(clean, bag, request, overwrite=self.overwrite, workers=self.workers)

    def _report(self, bags: Sequence[Path]) -> Part:
        report = self.folder / "reports" / detector_slug(self.detector)
        if is_report_of(report, bags, self.detector, self.device, self.adaptation):
            return Kept("report", report)
        options = Options(detectors=(self.detector,), device=self.device, **vars(self.adaptation))
        clean, *adversarial = bags
        adversarial = adversarial or adversarial_bags(self.folder)
        detail(f"{self.detector} on {self.device}: {clean} and {len(adversarial)} adversarial bags")
        with working_on(EVALUATING):
            made = evaluate(
                clean, adversarial, report, options, overwrite=self.overwrite, workers=self.workers
            )
        return Evaluated(made, report)


def mistakes_of_attacks(
    attacks: Sequence[AttackSpec], scenario: Scenario | None
) -> Iterator[tuple[int | None, str]]:
    """What is wrong with the attacks on one bag of a scenario, as `load_scenario` asks for it."""
    found = [(number, text) for number, spec in enumerate(attacks) for text in mistakes_of_spec(spec)]
    yield from found
    if found or not attacks:
        return
    request = AttackRequest(tuple(attacks))
    try:
        request.check()
    except AdvpipeError as error:
        yield None, str(error)
    if scenario is not None:
        for number, spec in enumerate(request.attacks):
            if spec in request.of("v2x") and not scenario.v2x.enabled:
                yield number, f"{spec.type} attacks V2X, but v2x.enabled is false"


def has_drive(folder: Path, scenario: Scenario, overwrite: bool) -> bool:
    """Whether a data set holds the drive of this scenario, whatever its attacks."""
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


def is_made_by(request: AttackRequest, clean: Path, bag: Path, overwrite: bool) -> bool:
    """Whether the same request made the bag of the same clean one; raises UsageError where another did."""
    made = bag / "attack.yaml"
    wanted = resolved_text(job_provenance(BagReader(clean), request))
    if not made.is_file():
        return False
    others = _differing_keys(made, wanted)
    if others and not overwrite:
        raise UsageError(
            f"{bag} was made with other {', '.join(others)} (see {made.name} in it); pass --overwrite to "
            "make it again, or give another --out"
        )
    return not others


def _differing_keys(made: Path, wanted: str) -> list[str]:
    """The top-level keys of two YAML texts whose values differ; `text` if one is not a mapping."""
    try:
        text = read_text(made)
        if text == wanted:
            return []
        old, new = (read_yaml(each, dict[ShortText, Any], str(made), "") for each in (text, wanted))
    except AdvpipeError:
        return ["text"]
    return sorted(key for key in old.keys() | new.keys() if old.get(key) != new.get(key)) or ["text"]


def with_adaptation(spec: AttackSpec, adaptation: Adaptation) -> AttackSpec:
    """An attack, with the adaptation if it is one on clouds that does not state its own."""
    if adaptation.is_none or not adaptation_of(spec).is_none or find_attack(spec.type).family != "lidar":
        return spec
    return spec.model_copy(update=vars(adaptation))


def is_report_of(
    report: Path, bags: Sequence[Path], detector: str, device: str, adaptation: Adaptation = AS_THEY_ARE
) -> bool:
    """Whether an evaluation's report compares just these bags, with this detector, device, adaptation and
    code."""
    try:
        found = read_report(report / "report.json")
    except AdvpipeError:
        return False
    if isinstance(found, SweepReportDocument):
        return False
    about = found.provenance
    scored = [about.clean.sha256, *(bag.sha256 for bag in about.compared if bag.sha256)]
    detectors = [one.sha256 for one in about.detectors]
    was_here = about.device == device.partition(":")[0]
    was_so = about.code_sha256 == code_sha256(*REPORTING)
    was_adapted = Adaptation() if about.adaptation is None else Adaptation(**vars(about.adaptation))
    was_so &= was_adapted == adaptation
    is_of_bags = sorted(scored) == sorted(map(parent_sha256, bags))
    return is_of_bags and detectors in ([], [detector_sha256(detector)]) and was_here and was_so

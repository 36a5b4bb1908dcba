"""What each family of attacks adds to a report besides detection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from advpipe.pipeline.bag.frames import find_lidar_topic
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import window_of
from advpipe.stages.evaluate.camera.section import camera_sections as camera
from advpipe.stages.evaluate.cooperative.collective import collective_sections as collective
from advpipe.stages.evaluate.cooperative.section import cooperative_sections as cooperative
from advpipe.stages.evaluate.coordinated.effects import DetectedFrames
from advpipe.stages.evaluate.coordinated.section import coordinated_sections as coordinated
from advpipe.stages.evaluate.detection.summary import Summary
from advpipe.stages.evaluate.kitti.section import kitti_sections as kitti
from advpipe.stages.evaluate.localisation.section import localisation_sections as localisation
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.radar.section import radar_sections as radar
from advpipe.stages.evaluate.report.clean import of_first_detector
from advpipe.stages.evaluate.report.section import ReportSection
from advpipe.stages.evaluate.v2x.denm_section import denm_sections as denm
from advpipe.stages.evaluate.v2x.privacy import privacy_sections as privacy
from advpipe.stages.evaluate.v2x.section import v2x_sections as v2x
from advpipe.stages.evaluate.v2x.signed_messages import security_sections as security

OF_WINDOW = (
    "All values of this part are of the window of {length_s:.1f} s from the first chosen cloud to one "
    "period after the last. Filters, radio, maps and detectors ran from the beginning of the drive to the "
    "window's end."
)


def added_sections(
    clean: Path, adversarial: Sequence[Path], options: Options, summaries: Sequence[Summary] = ()
) -> list[ReportSection]:
    """The sections of all families; where frames were chosen, with a note on the window of each.

    A family without results adds no section. Raises AdvpipeError for options that choose no frame.
    """
    window = window_of(BagReader(clean), options.frames, options.lidar_topic)
    seen = partial(coordinated, detected=_detected(clean, options, summaries))
    judged = partial(v2x, detectors=options.misbehaviour)
    sections = [
        section
        for family in (seen, localisation, judged, collective, radar)
        for section in family(clean, adversarial, options.seed, window=window)
    ]
    sections += camera(clean, adversarial, options.image_detector, options.device, window)
    if window.end_ns is not None:
        note = OF_WINDOW.format(length_s=(window.end_ns - window.begin_ns) / 1e9)
        sections = [replace(section, notes=(*section.notes, note)) for section in sections]
    whole = [each for family in (security, privacy, denm) for each in family(clean, adversarial)]
    own_rules = kitti(clean, summaries, options)
    fused = cooperative(
        clean,
        adversarial,
        options.seed,
        detector=options.detectors[0],
        device=options.device,
        frames=options.frames,
        lidar_topic=options.lidar_topic,
        adaptation=options.adaptation,
    )
    return [*own_rules, *sections, *whole, *fused]


def _detected(clean: Path, options: Options, summaries: Sequence[Summary]) -> dict[Path, DetectedFrames]:
    """What the first detector found in the clouds of each adversarial bag that it was shown."""
    if not summaries:
        return {}
    vehicle = find_lidar_topic(BagReader(clean), options.lidar_topic).strip("/").partition("/")[0]
    return {
        each.comparison.bag: DetectedFrames(vehicle, each.per_frame)
        for each in of_first_detector(summaries)
        if each.comparison.bag
    }

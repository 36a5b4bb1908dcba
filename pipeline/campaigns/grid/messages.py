"""Scores an attack on messages or fixes in a grid: what vehicles believe of where they and others are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from advpipe.pipeline.campaigns.grid.cell import GridValues
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.pipeline.results.v2x import V2xRecord
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.provenance import MESSAGES
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.evaluate.localisation.section import localisation_sections
from advpipe.stages.evaluate.provenance import REPORTING
from advpipe.stages.evaluate.v2x.section import v2x_sections

MESSAGE_CODE = (*REPORTING, *MESSAGES)
"""The code that decides the figures of such a cell."""

LOCALISATION, V2X = "localisation of ", "V2X of "
"""What the strata of such a cell begin with; a vehicle's name follows."""


def leaves_clouds(specs: Sequence[AttackSpec]) -> bool:
    """Whether the attacks on one bag leave its clouds as they are: no detector sees a difference."""
    return all(find_attack(spec.type).family != "lidar" for spec in specs)


def score_messages(clean: Path, bag: Path, seed: int) -> tuple[GridValues, ...]:
    """The figures of each vehicle whose fixes were attacked, and of each that received false messages.

    Without any, one row that says only that there is nothing.
    """
    found = [*_localisation(clean, bag, seed), *_v2x(clean, bag, seed)]
    return tuple(found) or (GridValues(stratum="nothing attacked", **_NO_CLOUDS),)


_NO_CLOUDS = {"objects": 0, "frames": 0, "map_clean": None, "map_adv": None}


def _localisation(clean: Path, bag: Path, seed: int) -> Iterator[GridValues]:
    for section in localisation_sections(clean, [bag], seed):
        for record in section.records:
            assert isinstance(record, LocalisationRecord)
            yield _row(
                stratum=LOCALISATION + record.vehicle,
                position_rmse_clean_m=record.clean.rmse_m,
                position_rmse_adv_m=record.adversarial.rmse_m,
                fixes_detected_percent=100 * record.detection_rate,
                off_course_percent=100 * record.success_rate,
            )


def _v2x(clean: Path, bag: Path, seed: int) -> Iterator[GridValues]:
    for section in v2x_sections(clean, [bag], seed):
        for record in section.records:
            assert isinstance(record, V2xRecord)
            if not record.attack:
                continue  # the clean bag
            before, after = record.ldm_attacked_clean, record.ldm_attacked
            yield _row(
                stratum=V2X + record.vehicle,
                false_messages=record.false_messages,
                misbehaviour_f1=record.ours.f1,
                misbehaviour_recall=record.ours.recall,
                ldm_error_clean_m=before.error_m if before else None,
                ldm_error_adv_m=after.error_m if after else None,
                false_ldm_entries=after.false_entries if after else None,
                honest_delivered_clean_percent=100 * record.honest_delivered_clean,
                honest_delivered_percent=100 * record.honest_delivered,
                false_warnings=record.warning.false_alarms,
            )


def _row(stratum: str, **values: object) -> GridValues:
    plain = plain_value({**_NO_CLOUDS, "stratum": stratum, **values})
    return GridValues.model_validate(plain)

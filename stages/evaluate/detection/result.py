"""The row of a report that a scored comparison makes, and what the reader must know of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from advpipe.pipeline.geometry.boxes import MIN_POINTS
from advpipe.pipeline.metrics.bootstrap import MIN_BLOCK_S
from advpipe.pipeline.results.figures import BaselineFigures, CloudFigures
from advpipe.pipeline.results.row import AttackRecord, FrameCounts, ResultRow
from advpipe.stages.evaluate.detection.baseline import baseline_title, baseline_words
from advpipe.stages.evaluate.detection.comparison import Comparison
from advpipe.stages.evaluate.detection.figures import (
    attack_figures,
    clean_figures,
    difference,
    found_on_clean,
    recounted_figures,
)
from advpipe.stages.evaluate.detection.scored import Scored

FEW_BLOCKS = 10


def result_row(
    scored: Scored, boxes: Mapping[str, int], notes: Sequence[str], remarks: Sequence[str]
) -> ResultRow:
    """The figures of a comparison; boxes: evaluated ones by class; notes and remarks: first and last ones."""
    comparison, arms, rows = scored.comparison, scored.arms, scored.per_frame
    attack = attack_of(comparison)
    attacked = _figures(scored, "adv") if "adv" in arms else None
    baselines = {word: _baseline(scored, word) for word in baseline_words() if word in arms}
    beaten = [each.is_significant for each in baselines.values()]
    significant_vs_random = None if not beaten or None in beaten else all(beaten)
    said = [*notes, *_on_blocks(scored.bootstrap.n_blocks)]
    if attacked and arms["clean"].mean_ap() == 0:
        said.append("The mAP on the clean clouds is 0: the mAP ratio is undefined.")
    if attacked and (hidden := attacked.objects_below_min_points):
        said.append(f"{hidden} of the objects have fewer than {MIN_POINTS} points left; they still count.")
    said += _on_baselines(attack, baselines, significant_vs_random)
    return ResultRow(
        bag=comparison.name,
        detector=comparison.detector,
        attack=attack,
        counts=FrameCounts(
            frames=len(rows),
            blocks=scored.bootstrap.n_blocks,
            classes_in_map=scored.in_map,
            working_score=scored.min_score,
            objects=sum(boxes.values()),
            objects_found_clean=found_on_clean(rows),
            false_positives_clean=sum(row.clouds["clean"].false_positives for row in rows),
            points_clean=sum(row.clouds["clean"].points for row in rows),
        ),
        boxes={name: boxes[name] for name in scored.classes},
        clean=clean_figures(arms["clean"]),
        attacked=attacked,
        recounted=(
            recounted_figures(arms["adv"], arms["clean"], comparison.frames, rows, "adv")
            if attacked
            else None
        ),
        baselines=baselines,
        significant_vs_random=significant_vs_random,
        notes=(*said, *remarks),
    )


def attack_of(comparison: Comparison) -> AttackRecord:
    """Attack, recipe, and its budget: the parameter that the attack names, else its first."""
    provenance = comparison.provenance
    parameters = provenance.parameters
    parameter = provenance.get("budget", next(iter(parameters), None))
    return AttackRecord(
        attack=provenance.get("attack", "none" if not provenance else "unknown"),
        recipe=provenance.get("recipe"),
        parameter=parameter,
        value=parameters.get(parameter) if parameter else None,
        parameters=parameters,
        attacked_against=provenance.get("detector"),
        is_white_box=comparison.is_white_box,
        query_budget=provenance.fields.looks,
        baseline_tries=comparison.baseline_tries,
    )


def _figures(scored: Scored, word: str) -> CloudFigures:
    arms, frames = scored.arms, scored.comparison.frames
    return attack_figures(arms[word], arms["clean"], frames, scored.per_frame, word)


def _baseline(scored: Scored, word: str) -> BaselineFigures:
    """A random baseline; it is beaten if the 95 % interval of the paired difference to it is below 0."""
    points, bounds = difference(scored.arms, word)
    return BaselineFigures(
        figures=_figures(scored, word),
        map_ratio_delta_points=points,
        map_ratio_delta_points_ci95=bounds,
        is_significant=None if bounds is None else bounds[1] < 0,
    )


def _on_blocks(n_blocks: int) -> list[str]:
    if n_blocks < 2:
        return [f"The frames fill less than two blocks of {MIN_BLOCK_S:g} s: no confidence interval."]
    if n_blocks < FEW_BLOCKS:
        return [f"Only {n_blocks} blocks of {MIN_BLOCK_S:g} s: the confidence intervals are rough."]
    return []


def _on_baselines(
    attack: AttackRecord, baselines: Mapping[str, BaselineFigures], significant_vs_random: bool | None
) -> list[str]:
    """Whether the baselines had fewer tries than the attack, and which of them it does not beat."""
    tries, notes = attack.baseline_tries, []
    if attack.query_budget is not None and 0 < tries < attack.query_budget:
        best_of = f"the best of {tries}, the attack is the best of {attack.query_budget} tries"
        notes = [f"The random baselines are {best_of}."]
    if significant_vs_random is not False:
        return notes
    unbeaten = [baseline_title(word) for word, each in baselines.items() if not each.is_significant]
    return [*notes, f"Does not beat the same budget spent {'; '.join(unbeaten)}."]

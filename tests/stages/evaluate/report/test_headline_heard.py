"""The first screen's parts on CPMs and DENMs."""

from __future__ import annotations

import math
from dataclasses import replace

from advpipe.pipeline.results.collective_perception import CollectivePerceptionRecord
from advpipe.pipeline.results.v2x_security import DenmRecord
from advpipe.stages.evaluate.report.headline_heard import cpm_headline, denm_headline
from advpipe.stages.evaluate.report.headline_parts import BAD

NAN = math.nan
REPORTS = CollectivePerceptionRecord(
    bag="clean",
    vehicle="ego",
    instants=40,
    unseen=100,
    known_by_cams=0.1,
    known_with_cpms=0.9,
    heard=800,
    heard_false=0.01,
    attacked=0,
    free_space_tpr=NAN,
    free_space_fpr=0.02,
    witnesses_tpr=NAN,
    witnesses_fpr=0.0,
    silent=0,
    omission_tpr=NAN,
    omission_fpr=0.0,
)
WARNINGS = DenmRecord(
    bag="clean",
    vehicle="ego",
    messages=90,
    false_messages=0,
    events=12,
    known=11,
    false_events=0,
    suppressed=0,
    recall=NAN,
    false_positive_rate=0.0,
)


def test_the_attack_with_the_largest_effect_on_what_is_heard() -> None:
    ghosts = replace(REPORTS, bag="cpm-ghost", attacked=80, heard_false=0.2, free_space_tpr=0.75)
    removed = replace(REPORTS, bag="cpm-remove", silent=9, known_with_cpms=0.3)
    found = cpm_headline([ghosts, removed], [REPORTS])
    assert found.bag == "cpm-remove"
    assert found.attacks == ("cpm-ghost", "cpm-remove")
    assert "leaves it 30.0 % of the road users" in found.verdict
    assert "(clean: 90.0 %)" in found.verdict
    false, known, free = cpm_headline([ghosts], [REPORTS]).cards
    assert (false.value, false.beside, false.meant) == ("20.0 %", "clean: 1.0 %", BAD)
    assert (known.value, known.meant) == ("90.0 %", "")
    assert (free.value, free.beside) == ("75.0 %", "honest objects: 2.0 %")


def test_false_and_suppressed_warnings() -> None:
    false = replace(WARNINGS, bag="denm-false", false_messages=40, false_events=7, recall=0.5)
    found = denm_headline([false], [WARNINGS])
    assert found.verdict == (
        "The attack sends false warnings (DENMs). It warns ego of 7 events that do not exist, and ends 0 "
        "true ones for it; of 12 true events nearby it learns of 11 (clean: 11)."
    )
    assert [card.meant for card in found.cards] == [BAD, "", ""]

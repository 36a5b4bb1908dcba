"""The explained values of a report are those that `report.json` holds."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from typing import Any

import pytest

from advpipe.pipeline.results.schema import report_schema
from advpipe.stages.evaluate.cooperative import section as cooperative
from advpipe.stages.evaluate.coordinated import section as coordinated
from advpipe.stages.evaluate.localisation import section as localisation
from advpipe.stages.evaluate.report.report import DEFINITIONS
from advpipe.stages.evaluate.report.section import Formula
from advpipe.stages.evaluate.v2x import denm_section, privacy, signed_messages
from advpipe.stages.evaluate.v2x import section as v2x

DETECTION = (
    "rows",
    "average_precision",
    "attack_detection",
    "attack_success",
    "attack_effects",
    "baselines",
    "transfer",
    "defences",
)
SECTIONS = [
    (DETECTION, DEFINITIONS),
    (("localisation",), localisation.FORMULAS),
    (("v2x",), v2x.FORMULAS),
    (("security",), (signed_messages.FORMULA,)),
    (("privacy",), (privacy.FORMULA,)),
    (("denm",), (denm_section.FORMULA,)),
    (("cooperative",), cooperative.FORMULAS),
    (("coordinated",), coordinated.FORMULAS),
]


EXAMPLES = ("car", "map_adv", "baseline", "map_ratio_recounted")
"""What `*` in a key may stand for, where keys are patterns."""


@pytest.mark.parametrize(("lists", "formulas"), SECTIONS)
def test_keys_are_those_of_the_schema(lists: tuple[str, ...], formulas: tuple[Formula, ...]) -> None:
    schemas = [report_schema()["properties"][name]["items"] for name in lists]
    for formula in formulas:
        for key in formula.keys:
            assert any(holds(schema, key) for schema in schemas), (formula.name, key)


def holds(schema: dict[str, Any], key: str) -> bool:
    """Whether an object of the schema, or of a list in it, has such a key."""
    names = [key.replace("*", example) for example in EXAMPLES]
    inner = [each.get("items", {}) for each in schema["properties"].values()]
    return (
        any(fnmatchcase(each, key) for each in schema["properties"])
        or any(re.search(pattern, name) for pattern in schema.get("patternProperties", {}) for name in names)
        or any(holds(each, key) for each in inner if "properties" in each)
    )

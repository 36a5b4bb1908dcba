"""The records of a section as `report.json` has them, which keep to its published schema."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator

from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.schema import report_schema
from advpipe.stages.evaluate.report.section import ReportSection


def rows_of(section: ReportSection) -> list[dict[str, Any]]:
    """One dict a record; fails for a record that the schema does not let in."""
    rows = [record.record() for record in section.records]
    _validator(section.key).validate(json.loads(json.dumps(plain_value(rows))))
    return rows


@cache
def _validator(key: str) -> Draft202012Validator:
    return Draft202012Validator(report_schema()["properties"][key])

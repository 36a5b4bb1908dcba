"""The JSON Schema of scenario files: what editors complete and check them with."""

from __future__ import annotations

import json
from typing import Any

from advpipe.pipeline.scenario.models import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The schema as plain values: every key with its type, bounds, default and description.

    Keys that hold a path have the format `path`. What keys ask of each other is not in it; `load_scenario`
    checks that.
    """
    schema = _closed(Scenario.model_json_schema())
    return {"$schema": DIALECT, **schema, "title": "advpipe scenario"}


def _closed(node: Any) -> Any:
    """The same schema; mappings whose names have a pattern refuse the names that do not fit."""
    if isinstance(node, list):
        return [_closed(item) for item in node]
    if not isinstance(node, dict):
        return node
    extra = {"additionalProperties": False} if "patternProperties" in node else {}
    return {**{key: _closed(item) for key, item in node.items()}, **extra}


def schema_json() -> str:
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False)

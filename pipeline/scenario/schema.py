"""The JSON Schema of scenario files, with which editors complete and check them."""

from __future__ import annotations

import json
from typing import Any

from advpipe.pipeline.scenario.models import Scenario

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scenario_schema() -> dict[str, Any]:
    """The schema as plain values: every key with its type, bounds, default and description.

    Keys that hold a path have the format `path`. Constraints across keys are not in the schema;
    `load_scenario` checks them.
    """
    schema = _closed(Scenario.model_json_schema())
    return {"$schema": DIALECT, **schema, "title": "advpipe scenario"}


def _closed(node: Any) -> Any:
    """The same schema with mappings whose names have a pattern closed to names that do not match it."""
    if isinstance(node, list):
        return [_closed(item) for item in node]
    if not isinstance(node, dict):
        return node
    extra = {"additionalProperties": False} if "patternProperties" in node else {}
    return {**{key: _closed(item) for key, item in node.items()}, **extra}


def schema_json() -> str:
    """The schema as an indented JSON text."""
    return json.dumps(scenario_schema(), indent=2, ensure_ascii=False)

"""The JSON Schema of `report.json`, made from the definitions of its results."""

from __future__ import annotations

import json
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Union, get_args, get_origin, get_type_hints

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.results.evaluation import SCHEMA
from advpipe.pipeline.results.figures import CRITERIA, CloudFigures, RecountedFigures
from advpipe.pipeline.results.origin import Origin
from advpipe.pipeline.results.records import (
    BaselineRecord,
    DefenceRecord,
    DefendedFigures,
    PrecisionRecord,
    SuccessRecord,
    TransferRecord,
    key_of,
)
from advpipe.pipeline.results.row import PLAIN_BASELINE, AttackRecord, FrameCounts

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_BASELINE = "(baseline(_near|_full)?(_best)?)"
_CLASS = f"({'|'.join(CLASSES)})"
_CRITERION = f"({'|'.join(CRITERIA[1:])})"

Schema = dict[str, Any]

NUMBER: Schema = {"type": ["number", "null"]}
INTERVAL: Schema = {"type": ["array", "null"], "items": {"type": "number"}, "minItems": 2, "maxItems": 2}


def report_schema() -> Schema:
    """The schema as plain values.

    A figure that is undefined is null. What families of attacks list besides is an array of objects.
    """
    lists = {
        "average_precision": PrecisionRecord,
        "attack_success": SuccessRecord,
        "baselines": BaselineRecord,
        "transfer": TransferRecord,
    }
    required = ["average_precision", "banners", "formulas", "provenance", "rows", "schema"]
    return {
        "$schema": DIALECT,
        "title": "advpipe report",
        "type": "object",
        "properties": {
            "schema": {"const": SCHEMA},
            "banners": _list({"type": "string"}),
            "formulas": {"type": "object", "additionalProperties": {"type": "string"}},
            "provenance": _object(Origin, optional=("device",)),
            "rows": _list(_row()),
            **{key: _list(_object(record)) for key, record in lists.items()},
            "defences": _list(_defence()),
        },
        "required": required,
        "additionalProperties": _list({"type": "object"}),
    }


def report_schema_json() -> str:
    """The text that is published as `docs/schemas/report-1.json`."""
    return json.dumps(report_schema(), indent=2, ensure_ascii=False)


def _row() -> Schema:
    """A row is flat: of the attack's figures and of each baseline's, with its word before them."""
    figures = _properties(CloudFigures)
    properties = {
        "bag": {"type": "string"},
        "detector": {"type": "string"},
        **_properties(AttackRecord),
        **_properties(FrameCounts),
        **{key: _or_null(value) for key, value in {**figures, **_properties(RecountedFigures)}.items()},
        "map_clean": NUMBER,
        "map_clean_ci95": INTERVAL,
        "map_r11_clean": NUMBER,
        f"map_ratio_minus_{PLAIN_BASELINE}": NUMBER,
        f"map_ratio_minus_{PLAIN_BASELINE}_ci95": INTERVAL,
        "baselines": _list({"type": "string", "pattern": f"^{_BASELINE}$"}),
        "beats_random": {"type": ["boolean", "null"]},
        "notes": _list({"type": "string"}),
    }
    of_baselines = {f"^{_BASELINE}_{key}$": _or_null(value) for key, value in figures.items()}
    patterns = {
        f"^boxes_{_CLASS}$": {"type": "integer"},
        f"^map_{_CRITERION}(_r11)?_clean$": NUMBER,
        f"^map_{_CRITERION}_clean_ci95$": INTERVAL,
        f"^ap_({_CRITERION}_)?{_CLASS}_clean$": NUMBER,
        f"^({_BASELINE}_)?ap_({_CRITERION}_)?{_CLASS}_adv$": NUMBER,
        f"^ap_{_CLASS}_clean_ci95$": INTERVAL,
        f"^({_BASELINE}_)?ap_{_CLASS}_adv_ci95$": INTERVAL,
        **of_baselines,
        f"^map_ratio_minus_{_BASELINE}$": NUMBER,
        f"^map_ratio_minus_{_BASELINE}_ci95$": INTERVAL,
        f"^beats_{_BASELINE}$": {"type": ["boolean", "null"]},
    }
    return {
        "type": "object",
        "description": "An adversarial bag, or the clean one alone, as one detector sees it.",
        "properties": properties,
        "patternProperties": patterns,
        "required": sorted(properties),
        "additionalProperties": False,
    }


def _defence() -> Schema:
    about, attacked = _properties(DefenceRecord), _properties(DefendedFigures)
    return {
        "type": "object",
        "description": _description(DefenceRecord),
        "properties": {**about, **attacked},
        "patternProperties": {
            f"^ap_({_CRITERION}_)?{_CLASS}_(clean|adv)$": NUMBER,
            f"^ap_{_CLASS}_(clean|adv)_ci95$": INTERVAL,
        },
        "required": sorted(about),
        "additionalProperties": False,
    }


def _object(record: type, optional: tuple[str, ...] = ()) -> Schema:
    properties = _properties(record)
    return {
        "type": "object",
        "description": _description(record),
        "properties": properties,
        "required": sorted(properties.keys() - set(optional)),
        "additionalProperties": False,
    }


def _properties(record: type) -> dict[str, Schema]:
    """The fields of a record that have a key of their own: average precisions have many, see `_row`."""
    hints = get_type_hints(record)
    nested = ("precisions", "clean_precisions", "attacked")
    return {
        key_of(field.name): _of_type(hints[field.name])
        for field in fields(record)
        if field.name not in nested
    }


def _of_type(hint: Any) -> Schema:
    """What a value of a field may be."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        (inner,) = (each for each in arguments if each is not type(None))
        return _or_null(_of_type(inner))
    if hint == tuple[float, float]:
        return {**INTERVAL, "type": "array"}
    if origin is tuple:
        return _list(_of_type(arguments[0]))
    if origin is Mapping:
        return {"type": "object", "additionalProperties": _of_type(arguments[1])}
    if is_dataclass(hint) and isinstance(hint, type):
        return _object(hint)
    return {str: {"type": "string"}, bool: {"type": "boolean"}, int: {"type": "integer"}, float: NUMBER}.get(
        hint, {}
    )


def _or_null(schema: Schema) -> Schema:
    kind = schema.get("type", [])
    kinds = [kind] if isinstance(kind, str) else list(kind)
    return {**schema, "type": [*kinds, "null"]} if kinds and "null" not in kinds else schema


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def _description(record: type) -> str:
    return " ".join((record.__doc__ or "").split())

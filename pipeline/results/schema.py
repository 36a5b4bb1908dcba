"""The JSON Schema of `report.json`, made from the definitions of its results."""

from __future__ import annotations

import json
import types
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, Union, get_args, get_origin

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.results.cooperative import CooperativeRecord
from advpipe.pipeline.results.coordinated import CoordinatedRecord
from advpipe.pipeline.results.deprecated import DEPRECATED_KEYS, old_key
from advpipe.pipeline.results.evaluation import SCHEMA
from advpipe.pipeline.results.figures import CRITERIA, CloudFigures, Precisions, RecountedFigures
from advpipe.pipeline.results.listed import Flat, LeftOut, key_of, shape
from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.pipeline.results.origin import ResultsOrigin
from advpipe.pipeline.results.records import (
    BaselineRecord,
    DefenceRecord,
    DefendedFigures,
    PrecisionRecord,
    SuccessRecord,
    TransferRecord,
)
from advpipe.pipeline.results.row import PLAIN_BASELINE, AttackRecord, FrameCounts
from advpipe.pipeline.results.v2x import V2xRecord

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_BASELINE = "(baseline(_near|_full)?(_best)?)"
_CLASS = f"({'|'.join(CLASSES)})"
_CRITERION = f"({'|'.join(CRITERIA[1:])})"

Schema = dict[str, Any]

NUMBER: Schema = {"type": ["number", "null"]}
INTERVAL: Schema = {"type": ["array", "null"], "items": {"type": "number"}, "minItems": 2, "maxItems": 2}


def report_schema() -> Schema:
    """The schema as plain values. A figure that is undefined is null; no other keys are let in."""
    lists = {
        "average_precision": PrecisionRecord,
        "attack_success": SuccessRecord,
        "baselines": BaselineRecord,
        "transfer": TransferRecord,
        "localisation": LocalisationRecord,
        "v2x": V2xRecord,
        "cooperative": CooperativeRecord,
        "coordinated": CoordinatedRecord,
    }
    required = ["average_precision", "warnings", "formulas", "provenance", "rows", "schema"]
    schema: Schema = {
        "$schema": DIALECT,
        "title": "advpipe report",
        "type": "object",
        "properties": {
            "schema": {"const": SCHEMA},
            "warnings": _list({"type": "string"}),
            "formulas": {"type": "object", "additionalProperties": {"type": "string"}},
            DEPRECATED_KEYS: {"type": "object", "additionalProperties": {"type": "string"}},
            "provenance": _object(ResultsOrigin, optional=("device",)),
            "rows": _list(_row()),
            **{key: _list(_object(record)) for key, record in lists.items()},
            "defences": _list(_defence()),
        },
        "required": required,
        "additionalProperties": False,
    }
    _add_deprecated(schema)
    return schema


def report_schema_json() -> str:
    """The text that is published as `docs/schemas/report-2.json`."""
    return json.dumps(report_schema(), indent=2, ensure_ascii=False)


def _add_deprecated(schema: Any) -> None:
    """Allow beside each renamed key the old one, marked as deprecated."""
    if isinstance(schema, list):
        for each in schema:
            _add_deprecated(each)
    if not isinstance(schema, dict):
        return
    for each in schema.values():
        _add_deprecated(each)
    for keyword, mark in (("properties", ""), ("patternProperties", "^")):
        for key, value in list(schema.get(keyword, {}).items()):
            if (old := old_key(key.removeprefix(mark))) is not None:
                schema[keyword][mark + old] = {**value, "deprecated": True}


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
        f"map_ratio_delta_points_vs_{PLAIN_BASELINE}": NUMBER,
        f"map_ratio_delta_points_vs_{PLAIN_BASELINE}_ci95": INTERVAL,
        "baselines": _list({"type": "string", "pattern": f"^{_BASELINE}$"}),
        "significant_vs_random": {"type": ["boolean", "null"]},
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
        f"^map_ratio_delta_points_vs_{_BASELINE}$": NUMBER,
        f"^map_ratio_delta_points_vs_{_BASELINE}_ci95$": INTERVAL,
        f"^significant_vs_{_BASELINE}$": {"type": ["boolean", "null"]},
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
    return {
        "type": "object",
        "description": _description(record),
        "properties": _properties(record),
        "required": sorted(_required(record) - set(optional)),
        "additionalProperties": False,
    }


def _properties(record: type) -> dict[str, Schema]:
    """The fields of a record that have a key of their own: average precisions have many, see `_row`."""
    properties: dict[str, Schema] = {}
    for name, (hint, mark) in shape(record).items():
        if isinstance(mark, Flat):
            inner = _properties(_without_none(hint))
            properties |= {mark.prefix + key: schema for key, schema in inner.items()}
        elif not _is_nested(hint):
            is_left_out = isinstance(mark, LeftOut)
            properties[key_of(name)] = _of_type(_without_none(hint) if is_left_out else hint)
    return properties


def _required(record: type) -> set[str]:
    """The keys that a record always has."""
    found: set[str] = set()
    for name, (hint, mark) in shape(record).items():
        if isinstance(mark, Flat) and isinstance(hint, type):
            found |= {mark.prefix + key for key in _required(hint)}
        elif mark is None and not _is_nested(hint):
            found.add(key_of(name))
    return found


def _is_nested(hint: Any) -> bool:
    """Whether a field holds average precisions, whose keys are patterns."""
    return _without_none(hint) in (Precisions, DefendedFigures)


def _without_none(hint: Any) -> Any:
    """What a field that may be None otherwise holds."""
    if get_origin(hint) not in (Union, types.UnionType):
        return hint
    (inner,) = (each for each in get_args(hint) if each is not type(None))
    return inner


def _of_type(hint: Any) -> Schema:
    """What a value of a field may be."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return _or_null(_of_type(_without_none(hint)))
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

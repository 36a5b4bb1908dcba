"""The JSON Schema of `report.json`, made from the definitions of its results."""

from __future__ import annotations

import json
import types
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any, Union, get_args, get_origin

from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.results.camera import CameraRecord
from advpipe.pipeline.results.collective_perception import CollectivePerceptionRecord
from advpipe.pipeline.results.cooperative import CooperativeRecord
from advpipe.pipeline.results.coordinated import CoordinatedRecord
from advpipe.pipeline.results.deprecated import DEPRECATED_KEYS, old_key
from advpipe.pipeline.results.evaluation import SCHEMA
from advpipe.pipeline.results.kitti import KittiRecord
from advpipe.pipeline.results.listed import Flat, LeftOut, described_fields, key_of
from advpipe.pipeline.results.localisation import LocalisationRecord
from advpipe.pipeline.results.metrics import CRITERIA, CloudMetrics, Precisions, RecountedMetrics
from advpipe.pipeline.results.origin import ResultsOrigin
from advpipe.pipeline.results.radar import RadarDetectionRecord, RadarRecord
from advpipe.pipeline.results.records import (
    AttackDetectionRecord,
    BaselineRecord,
    DefenceRecord,
    DefendedBaseline,
    DefendedMetrics,
    EffectRecord,
    PrecisionRecord,
    SuccessRecord,
    TransferRecord,
)
from advpipe.pipeline.results.row import PLAIN_BASELINE, AttackRecord, FrameCounts
from advpipe.pipeline.results.v2x import V2xRecord
from advpipe.pipeline.results.v2x_security import DenmRecord, PrivacyRecord, SecurityRecord

DIALECT = "https://json-schema.org/draft/2020-12/schema"

_BASELINE = "(random_best|baseline(_near|_full)?(_best)?)"
_CLASS = f"({'|'.join(CLASSES)})"
_CRITERION = f"({'|'.join(CRITERIA[1:])})"

_PRECISION = "average precision (R40)"

Schema = dict[str, Any]

NEWER: Mapping[str, tuple[str, ...]] = {
    "baselines": (
        *("map_loose_ratio_percent", "map_loose_ratio_ci95"),
        *("loose_delta_points", "loose_delta_points_ci95"),
    )
}
"""Keys of records that older reports of this version of the schema lack."""

NUMBER: Schema = {"type": ["number", "null"]}
INTERVAL: Schema = {"type": ["array", "null"], "items": {"type": "number"}, "minItems": 2, "maxItems": 2}


def report_schema() -> Schema:
    """The schema as plain values. An undefined metric is null; other keys are refused."""
    lists = {
        "average_precision": PrecisionRecord,
        "attack_detection": AttackDetectionRecord,
        "attack_effects": EffectRecord,
        "attack_success": SuccessRecord,
        "baselines": BaselineRecord,
        "transfer": TransferRecord,
        "kitti": KittiRecord,
        "localisation": LocalisationRecord,
        "v2x": V2xRecord,
        "security": SecurityRecord,
        "privacy": PrivacyRecord,
        "denm": DenmRecord,
        "cooperative": CooperativeRecord,
        "collective_perception": CollectivePerceptionRecord,
        "coordinated": CoordinatedRecord,
        "radar": RadarRecord,
        "radar_detection": RadarDetectionRecord,
        "camera": CameraRecord,
    }
    required = ["average_precision", "warnings", "formulas", "provenance", "rows", "schema"]
    schema: Schema = {
        "$schema": DIALECT,
        "title": "advpipe report",
        "type": "object",
        "properties": {
            "schema": {"const": SCHEMA, "description": "version of this schema"},
            "warnings": _list({"type": "string"}, "what must be read before any value"),
            "formulas": _texts("what the values mean, by name"),
            DEPRECATED_KEYS: _texts("old keys that are written beside their new ones, by old key"),
            "provenance": _object(ResultsOrigin, optional=("device", "adaptation", "attack_checks")),
            "rows": _list(_row(), "one for each adversarial bag and detector, or for the clean bag alone"),
            **{
                key: _list(_object(record, NEWER.get(key, ())), _description(record))
                for key, record in lists.items()
            },
            "defences": _list(_defence(), _description(DefenceRecord)),
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
    """A row is flat: the attack's metrics, and those of each baseline with its name before them."""
    metrics = _properties(CloudMetrics)
    absent = {"map_ratio_reason", *(key for key in metrics if hasattr(CloudMetrics, key))}
    absent |= {f"map_loose_ratio_delta_points_vs_{PLAIN_BASELINE}{end}" for end in ("", "_ci95")}
    properties = {
        "bag": _described({"type": "string"}, "adversarial bag, or `clean`"),
        "detector": _described({"type": "string"}, "evaluated detector"),
        **_properties(AttackRecord),
        **_properties(FrameCounts),
        **{key: _or_null(value) for key, value in {**metrics, **_properties(RecountedMetrics)}.items()},
        "map_clean": _described(NUMBER, "strict 3D mAP (R40) on the clean clouds, in [0, 1]"),
        "map_clean_ci95": _described(INTERVAL, "95 % interval of map_clean"),
        "map_r11_clean": _described(NUMBER, "strict 3D mAP (R11) on the clean clouds, in [0, 1]"),
        "map_ratio_reason": _described(
            {"type": "string"},
            "why the strict mAP ratios are not meaningful, and null; absent where they are meaningful",
        ),
        **{
            f"map_{kind}ratio_delta_points_vs_{PLAIN_BASELINE}{end}": value
            for kind in ("", "loose_")
            for end, value in _delta(kind).items()
        },
        "baselines": _list({"type": "string", "pattern": f"^{_BASELINE}$"}, "names of the scored baselines"),
        "significant_vs_random": _described(
            {"type": ["boolean", "null"]},
            "whether the attack is significantly stronger than random_best; null where the frames fill fewer "
            "than six blocks of 5 s, and without intervals",
        ),
        "notes": _list({"type": "string"}, "what the reader must know besides"),
    }
    patterns = {
        f"^boxes_{_CLASS}$": _described({"type": "integer"}, "number of evaluated objects of the class"),
        f"^map_{_CRITERION}(_r11)?_clean$": _described(NUMBER, "mAP on the clean clouds, in [0, 1]"),
        f"^map_{_CRITERION}_clean_ci95$": _described(INTERVAL, "95 % interval of the mAP"),
        f"^ap_({_CRITERION}_)?{_CLASS}_clean$": _described(
            NUMBER, f"{_PRECISION} on the clean clouds, in [0, 1]"
        ),
        f"^({_BASELINE}_)?ap_({_CRITERION}_)?{_CLASS}_adv$": _described(
            NUMBER, f"{_PRECISION} on attacked clouds or those of a baseline, in [0, 1]"
        ),
        f"^ap_{_CLASS}_clean_ci95$": _described(INTERVAL, f"95 % interval of the strict {_PRECISION}"),
        f"^({_BASELINE}_)?ap_{_CLASS}_adv_ci95$": _described(
            INTERVAL, f"95 % interval of the strict {_PRECISION}"
        ),
        **{
            f"^{_BASELINE}_{key}$": _or_null(_described(value, f"random baseline: {value['description']}"))
            for key, value in metrics.items()
        },
        **{
            f"^map_{kind}ratio_delta_points_vs_{_BASELINE}{end}$": value
            for kind in ("", "loose_")
            for end, value in _delta(kind).items()
        },
        f"^significant_vs_{_BASELINE}$": _described(
            {"type": ["boolean", "null"]},
            "whether the strict interval lies below 0; null with fewer than six blocks, and without one",
        ),
    }
    return {
        "type": "object",
        "description": "An adversarial bag, or the clean one alone, as one detector sees it.",
        "properties": properties,
        "patternProperties": patterns,
        "required": sorted(key for key in properties if key not in absent),
        "additionalProperties": False,
    }


def _delta(kind: str) -> dict[str, Schema]:
    """A difference to a baseline and its interval, by what their keys end with."""
    delta = f"the attack's {kind.replace('_', ' ')}mAP ratio minus the baseline's, in percentage points"
    return {
        "": _described(NUMBER, delta),
        "_ci95": _described(INTERVAL, f"95 % interval of: {delta}"),
    }


def _defence() -> Schema:
    about = _properties(DefenceRecord)
    attacked = _properties(DefendedMetrics) | _properties(DefendedBaseline)
    return {
        "type": "object",
        "description": _description(DefenceRecord),
        "properties": {**about, **attacked},
        "patternProperties": {
            f"^ap_({_CRITERION}_)?{_CLASS}_(clean|adv)$": _described(
                NUMBER, f"{_PRECISION} under the defence, in [0, 1]"
            ),
            f"^ap_{_CLASS}_(clean|adv)_ci95$": _described(
                INTERVAL, f"95 % interval of the strict {_PRECISION}"
            ),
        },
        "required": sorted(about.keys() - {"clean_map_loose_kept_percent"}),
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
    for name, (hint, mark, description) in described_fields(record).items():
        if isinstance(mark, Flat):
            for key, schema in _properties(_without_none(hint)).items():
                properties[mark.prefix + key] = _described(schema, mark.about + schema["description"])
        elif not _is_nested(hint):
            is_left_out = isinstance(mark, LeftOut)
            of_type = _of_type(_without_none(hint) if is_left_out else hint)
            properties[key_of(name)] = _described(of_type, description)
    return properties


def _required(record: type) -> set[str]:
    """The keys that a record always has."""
    found: set[str] = set()
    for name, (hint, mark, _) in described_fields(record).items():
        if isinstance(mark, Flat) and isinstance(hint, type):
            found |= {mark.prefix + key for key in _required(hint)}
        elif mark is None and not _is_nested(hint):
            found.add(key_of(name))
    return found


def _is_nested(hint: Any) -> bool:
    """Whether a field has no key of its own: average precisions, and what a defence leaves."""
    return _without_none(hint) in (Precisions, DefendedMetrics, DefendedBaseline)


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


def _list(items: Schema, description: str = "") -> Schema:
    return _described({"type": "array", "items": items}, description)


def _texts(description: str) -> Schema:
    return {"type": "object", "description": description, "additionalProperties": {"type": "string"}}


def _described(schema: Schema, description: str) -> Schema:
    return {**schema, "description": description} if description else schema


def _description(record: type) -> str:
    return " ".join((record.__doc__ or "").split())

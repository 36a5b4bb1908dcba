"""The published schema of report.json: what the code says, and what reports keep to."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from advpipe.pipeline.results.deprecated import new_key
from advpipe.pipeline.results.evaluation import SCHEMA
from advpipe.pipeline.results.metrics import CRITERIA
from advpipe.pipeline.results.schema import report_schema, report_schema_json
from advpipe.stages.evaluate.detection import scoring
from advpipe.stages.evaluate.detection.baseline import baseline_names

SCHEMAS = Path(__file__).parents[3] / "docs" / "schemas"
PUBLISHED, EARLIER = SCHEMAS / "report-2.json", SCHEMAS / "report-1.json"


def test_the_published_schema_is_that_of_the_code():
    """`advpipe schema --of report --out docs/schemas/report-2.json --overwrite` brings it up to date."""
    assert PUBLISHED.read_text() == report_schema_json() + "\n"
    assert f"advpipe-{PUBLISHED.stem}" == SCHEMA
    Draft202012Validator.check_schema(report_schema())


def test_it_knows_every_criterion_and_baseline():
    assert tuple(scoring.CRITERIA) == CRITERIA
    names = Draft202012Validator(report_schema()["properties"]["rows"]["items"]["properties"]["baselines"])
    names.validate(baseline_names())
    assert not names.is_valid(["baseline_far"])


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda report: report.update(schema="advpipe-report-1"), "schema"),
        (lambda report: report.pop("rows"), ""),
        (lambda report: report["provenance"].update(seed="none"), "provenance.seed"),
        (lambda report: report["provenance"]["clean"].pop("sha256"), "provenance.clean"),
        (lambda report: report.update(v2x={}), "v2x"),
        (lambda report: report.update(sonar=[]), ""),
        (lambda report: report["coordinated"][0].pop("attacks"), "coordinated.0"),
        (lambda report: report["coordinated"][0].update(attacked_fixes=None), "coordinated.0.attacked_fixes"),
        (lambda report: report["coordinated"][0].update(attacked_radars=1), "coordinated.0"),
    ],
)
def test_what_is_no_report_is_refused(change, where):
    report = {
        "schema": SCHEMA,
        "warnings": [],
        "formulas": {},
        "provenance": {
            "advpipe": "0",
            "code_sha256": "0",
            "clean": {"bag": "clean", "sha256": "0", "scenario": None},
            "compared": [],
            "detectors": [],
            "bootstrap_draws": 1000,
            "seed": 0,
            "baseline_tries": None,
            "defences": [],
        },
        "average_precision": [],
        "rows": [],
        "v2x": [],
        "coordinated": [
            {"bag": "three", "vehicle": "ego", "attacks": {"fixes": ["gnss-jump"]}, "attacked_fixes": 4}
        ],
    }
    report = json.loads(json.dumps(report))
    validator = Draft202012Validator(report_schema())
    assert list(validator.iter_errors(report)) == []
    change(report)
    (error,) = validator.iter_errors(report)
    assert ".".join(map(str, error.absolute_path)) == where


def test_every_key_of_the_earlier_schema_is_still_allowed():
    """Old keys are deprecated, not gone; report-1.json stays published for the reports that keep to it."""
    earlier, now = json.loads(EARLIER.read_text()), report_schema()
    Draft202012Validator.check_schema(earlier)
    plain, known = "(baseline(_near|_full)?(_best)?)", "(random_best|baseline(_near|_full)?(_best)?)"
    before = {tuple(part.replace(plain, known) for part in place): value for place, value in keys_of(earlier)}
    after = dict(keys_of(now))
    assert before.keys() <= after.keys()
    renamed = {place for place in before if new_key(place[-1])}
    assert {("banners",), ("v2x", "attacks", "lies")} <= renamed
    for place in renamed:
        of_new = after[(*place[:-1], new_key(place[-1]))]
        assert after[place] == {**of_new, "deprecated": True}


UNITS = {
    "_m": "metre",
    "_m2": "square metre",
    "_s": "second",
    "_deg": "degree",
    "_percent": "percent",
    "delta_points": "percentage point",
}


def test_every_key_is_described_with_its_unit():
    for place, value in keys_of(report_schema()):
        key = place[-1].removesuffix("$")
        assert value.get("description"), place
        for end, unit in UNITS.items():
            if key.endswith(end):
                assert unit in value["description"], place


def keys_of(schema, path=()):
    """Each key that the schema allows, by its path, and the schema of its value."""
    for keyword in ("properties", "patternProperties"):
        for key, value in schema.get(keyword, {}).items():
            place = (*path, key.removeprefix("^"))
            yield place, value
            yield from keys_of(value.get("items", value), place)

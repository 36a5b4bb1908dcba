"""What decides an adversarial bag's bytes: kept in the bag, and beside it as attack.yaml."""

from __future__ import annotations

import json
from typing import Any

import yaml

from advpipe.pipeline.bag.provenance import attack_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.stages.attack.request import AttackRequest


def provenance_of(reader: BagReader, request: AttackRequest) -> dict[str, str]:
    """The record of the bag that the request makes of this one; raises AdvpipeError for a bad request."""
    headline = request.headline()
    record = attack_provenance(
        reader.path, reader.provenance, **headline, seed=request.seed, frames=str(request.frames)
    )
    attacks = request.resolved()
    record["attacks"] = json.dumps(attacks, sort_keys=True)
    leading = next((one for one in attacks if "detector" in one), {})
    return record | {key: leading[key] for key in ("detector", "detector_sha256") if key in leading}


def resolved_text(provenance: dict[str, str]) -> str:
    """The text of attack.yaml: the request with every default filled in, and what it was run on."""
    plain: dict[str, Any] = {
        key: value for key, value in provenance.items() if key not in ("kind", "scenario")
    }
    for key in ("parameters", "attacks", "versions"):
        plain[key] = json.loads(plain[key])
    return yaml.safe_dump(plain, sort_keys=True)

"""What determines the bytes of an adversarial bag: stored in the bag, and beside it as attack.yaml."""

from __future__ import annotations

import json
from typing import Any

import yaml

from advpipe.pipeline.bag.provenance import attack_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core import plain_json
from advpipe.pipeline.core.code import CLOUDS, code_sha256
from advpipe.stages.attack.clouds import topic_of
from advpipe.stages.attack.lidar.build import build_lidar_attack, count_of
from advpipe.stages.attack.request import AttackRequest

JSON_KEYS = {"parameters", "attacks", "versions", "lidar_topics", "looks", "baseline_tries", "debug"}
"""The keys of a record that attack.yaml has as values."""

_WHEN = ("pipeline/scenario/attacks.py", "stages/attack/clouds.py", "stages/attack/recording.py")

LIDAR = (
    *CLOUDS,
    *_WHEN,
    "stages/attack/bounds.py",
    "stages/attack/cloud_attack.py",
    "stages/attack/lidar",
)
"""The code that determines which clouds change, and how."""

MESSAGES = (
    "pipeline/artery",
    "pipeline/bag",
    "pipeline/labels",
    "pipeline/messages",
    "pipeline/replay",
    "pipeline/geometry",
    "pipeline/localisation",
    "pipeline/scenario",
    "pipeline/core/index_ranges.py",
    "pipeline/core/seeding.py",
    *(
        f"pipeline/image_detector/{name}.py"
        for name in ("boxes", "checkpoint", "network", "network_detector", "protocol", "registry")
    ),
    *(
        f"pipeline/sensors/camera/{name}.py"
        for name in ("daylight", "exposure", "haze", "lens", "palette", "presets", "section", "sky_map")
    ),
    "pipeline/sensors/lidar/atmosphere.py",
    "pipeline/sensors/lidar/intensity.py",
    "pipeline/sensors/radar",
    "pipeline/sensors/weather.py",
    "pipeline/sensors/world.py",
    "pipeline/v2x",
    "pipeline/misbehaviour/roads.py",
    "stages/attack",
)
"""The code that determines how messages and fixes change."""


def job_provenance(reader: BagReader, request: AttackRequest) -> dict[str, str]:
    """The provenance record of the bag that the request makes. Raises AdvpipeError for a bad request."""
    headline = request.headline()
    record = attack_provenance(
        reader.path, reader.provenance, **headline, seed=request.seed, frames=str(request.frames)
    )
    attacks = request.resolved()
    record["attacks"] = json.dumps(attacks, sort_keys=True)
    record["debug"] = json.dumps(request.debug)
    code = (*(LIDAR if request.lidar else ()), *(MESSAGES if request.has_messages else ()))
    record["code_sha256"] = code_sha256(*code)
    if request.lidar:
        topics = sorted({topic_of(reader, spec) for spec in request.lidar})
        record["lidar_topics"] = json.dumps(topics)
    lidar = [build_lidar_attack(spec) for spec in request.lidar]
    for key in ("query_budget", "baseline_tries"):
        if known := [count for each in lidar if (count := count_of(each, key)) is not None]:
            record["looks" if key == "query_budget" else key] = str(max(known))
    leading = next((one for one in attacks if "detector" in one), {})
    return record | {key: leading[key] for key in ("detector", "detector_sha256", "device") if key in leading}


def resolved_text(provenance: dict[str, str]) -> str:
    """The text of attack.yaml: the request with all defaults, and the bag that it was run on."""
    plain: dict[str, Any] = {
        key: value for key, value in provenance.items() if key not in ("kind", "scenario")
    }
    for key in {
        "parameters",
        "attacks",
        "versions",
        "lidar_topics",
        "looks",
        "baseline_tries",
        "debug",
    } & plain.keys():
        plain[key] = plain_json.load_json(plain[key])
    return yaml.safe_dump(plain, sort_keys=True)

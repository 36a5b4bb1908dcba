"""The file of `advpipe relay`."""

import json
from pathlib import Path

import pytest

from advpipe.pipeline.campaigns.relay.options import RelayOptions
from advpipe.pipeline.campaigns.relay.run import relay
from advpipe.pipeline.campaigns.relay.settings import load_relay_settings, relay_schema_json
from advpipe.pipeline.core.errors import UsageError


def load(folder: Path, text: str) -> object:
    (folder / "relay.yaml").write_text(text)
    return load_relay_settings(folder / "relay.yaml")


def test_a_short_file(tmp_path: Path) -> None:
    found = load_relay_settings(written(tmp_path, "attacks: {type: detach, recipe: random}"))
    assert [spec.type for spec in found.attacks] == ["detach"]
    assert found.cloud_topic == "/ego/lidar/points"
    assert found.when_late == "pass"


def written(folder: Path, text: str) -> Path:
    (folder / "relay.yaml").write_text(text)
    return folder / "relay.yaml"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("attacks: []", "lists no attack"),
        ("seed: 1", "attacks: Field required"),
        ("attacks: {type: detach}\ncloud: /x", "cloud: Extra inputs are not permitted"),
        ("attacks: {type: detach}\ncloud_topic: points", "cloud_topic: String should match"),
        ("attacks: {type: detach}\nmax_latency_s: 0", "max_latency_s: Input should be greater than 0"),
        ("attacks: {type: detach, frames: '0:3'}", "detach: a relay has no use for frames; leave it out"),
        ("attacks: {type: detach}\nfix_topic: /a/b\npacket_topic: /a/b", "two of the topics are the same"),
        ("attacks: {type: cam-drop}\npacket_topic: ''\ncam_topic: ''", "packet_topic and cam_topic are both"),
        ("attacks: [", "not valid YAML"),
    ],
)
def test_refusals_are_one_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(UsageError) as found:
        load(tmp_path, text)
    assert line in str(found.value)
    assert str(found.value).startswith(str(tmp_path))
    assert "\n" not in str(found.value)


def test_attacks_on_radars_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "relay.yaml"
    path.write_text("attacks: {type: radar-jam}\n", encoding="utf-8")
    with pytest.raises(UsageError, match="radar-jam: relay attacks no radars; attack a recorded drive"):
        relay(tmp_path / "out", RelayOptions(attack=path, ros2=True, domain=1))
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read: No such file"):
        load_relay_settings(tmp_path / "nowhere.yaml")


@pytest.mark.oracle
def test_the_schema_accepts_what_is_accepted(tmp_path: Path) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(relay_schema_json())
    jsonschema.Draft202012Validator.check_schema(schema)
    good = {"attacks": {"type": "gnss-drift"}, "seed": 3, "max_latency_s": 0.1, "when_late": "drop"}
    jsonschema.validate(good, schema)
    for bad in ({}, {**good, "when_late": "never"}, {**good, "other": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(bad, schema)

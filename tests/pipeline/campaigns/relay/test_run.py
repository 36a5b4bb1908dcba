"""`advpipe relay` as users run it, between a player and a consumer in processes of their own."""

import contextlib
import hashlib
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from dds_process import dds_subscriber, new_domain
from first_words import without_progress
from relay_messages import BEGIN_NS, fix_cdr

from advpipe.commands.relay import relay
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.messages.build import clock
from advpipe.pipeline.messages.topics import CLOCK, VehicleTopics
from advpipe.stages.evaluate.localisation.section import localisation_sections
from advpipe.stages.evaluate.v2x.section import v2x_sections

SAMPLE = str(shipped_sample() / "clean")
ADVPIPE = [sys.executable, "-m", "advpipe"]
FILE = """
attacks:
  - {type: remove-sector, parameters: {width_deg: 40}}
  - {type: cam-speed-constant, attackers: {share: 1.0}}
  - {type: gnss-relocate}
max_latency_s: 30
"""


@contextlib.contextmanager
def relaying(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    pipe = subprocess.PIPE
    with subprocess.Popen([*ADVPIPE, "relay", *arguments], stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def wait_until_it_stands(process: subprocess.Popen[str]) -> None:
    assert process.stderr is not None
    while "the relay stands in" not in (line := process.stderr.readline()):
        assert line, process.communicate()


def play(domain: int, *more: str) -> None:
    where = ["--ros2", "--domain", str(domain), "--interface", "lo", "--delay", "3", "-q", *more]
    subprocess.run([*ADVPIPE, "play", SAMPLE, *where], check=True, capture_output=True)


@pytest.mark.oracle
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)])
def test_a_consumer_receives_what_the_bag_records(tmp_path: Path, number: signal.Signals) -> None:
    """A signal ends it as at its end: the bag is whole, and has its labels. At night also with the bag that
    is played, with which the attack is scored."""
    pytest.importorskip("cyclonedds")
    domain, out = new_domain(), tmp_path / "relayed"
    (tmp_path / "relay.yaml").write_text(FILE)
    where = ["--ros2", "--domain", str(domain), "--interface", "lo", "--out", str(out), "--json"]
    is_scored = number == signal.SIGTERM
    where += ["--clean", SAMPLE] if is_scored else []
    topics = [(f"rt{prefix}/ego/lidar/points", "cloud", "reliable") for prefix in ("", "/evil")]
    with relaying("--attack", str(tmp_path / "relay.yaml"), "--prefix", "evil", *where) as process:
        wait_until_it_stands(process)
        with dds_subscriber(domain, *topics) as seen:
            play(domain)
            samples, publications = seen()
        process.send_signal(number)
        text, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    said = json.loads(text)
    clean, attacked = ([one for one in samples if one["topic"] == topic] for topic, *_ in topics)
    assert [one["stamp_ns"] for one in attacked] == [one["stamp_ns"] for one in clean]
    assert all(one["width"] < two["width"] for one, two in zip(attacked, clean, strict=True))
    reader = BagReader(out)
    recorded = [reader.decode(raw) for raw in reader.raw_messages(["/ego/lidar/points"])]
    assert [hashlib.sha256(one.data.tobytes()).hexdigest() for one in recorded] == [
        one["sha256"] for one in attacked
    ]
    assert publications["rt/evil/ego/gnss/fix"]["type"] == "sensor_msgs::msg::dds_::NavSatFix_"
    rows: dict[str, dict[str, Any]] = {row["topic"]: row for row in said["topics"]}
    assert {topic: row["received"] for topic, row in rows.items()} == {
        name: len(list(BagReader(Path(SAMPLE)).raw_messages([name]))) for name in rows
    }
    assert rows["/ego/lidar/points"]["attacked"] == len(clean) == 3
    assert rows["/ego/gnss/fix"]["attacked"] > 0
    frames = pq.read_table(out / "frames.parquet").to_pylist()
    assert [row["points_adversarial"] for row in frames] == [one["width"] for one in attacked]
    assert pq.read_table(out / "gnss_labels.parquet").num_rows == rows["/ego/gnss/fix"]["received"]
    assert {path.name for path in out.iterdir()} >= {"relay.yaml", "metadata.yaml", "labels.parquet"}
    assert said["reason"] == "until it was stopped"
    assert ("parent_sha256" in reader.provenance) == is_scored
    if is_scored:
        for sections_of in (localisation_sections, v2x_sections):
            (section,) = sections_of(Path(SAMPLE), [out])
            assert section.records


@pytest.mark.nightly
@pytest.mark.oracle
def test_a_slow_consumer_is_one_line_and_is_counted(tmp_path: Path) -> None:
    """One that takes a single message, and then sleeps: a stamp a cloud, ten a second, for eight seconds."""
    pytest.importorskip("cyclonedds")
    domain = new_domain()
    (raw, *_) = BagReader(Path(SAMPLE)).raw_messages(["/ego/lidar/points"])
    with BagWriter(tmp_path / "drive", provenance={"kind": "clean"}) as bag:
        for number in range(80):
            bag.write_cdr(raw.topic, raw.cdr, BEGIN_NS + number * 10**8)
    (tmp_path / "relay.yaml").write_text("attacks: {type: remove-sector}")
    where = ["--ros2", "--domain", str(domain), "--interface", "lo"]
    relay_where = [*where, "--attack", str(tmp_path / "relay.yaml"), "--out", str(tmp_path / "out"), "--json"]
    with (
        relaying(*relay_where) as process,
        dds_subscriber(domain, ("rt/attacked/ego/lidar/points", "cloud", "reliable"), slow_s=90),
    ):
        wait_until_it_stands(process)
        playing = ["play", str(tmp_path / "drive"), *where, "--delay", "3", "-q"]
        subprocess.run([*ADVPIPE, *playing], check=True)
        process.send_signal(signal.SIGINT)
        text, errors = process.communicate(timeout=60)
    (line,) = [line for line in errors.splitlines() if "too slow" in line]
    assert line.startswith("/attacked/ego/lidar/points: a reliable subscriber is too slow, or gone: ")
    (clouds,) = json.loads(text)["topics"]
    assert 20 < clouds["missed"] < clouds["sent"] == clouds["received"] == 80


@pytest.mark.nightly
@pytest.mark.oracle
def test_a_player_that_begins_again(tmp_path: Path) -> None:
    """/clock jumps back: the relay ends, and its bag has one time line."""
    pytest.importorskip("cyclonedds")
    domain, out = new_domain(), tmp_path / "relayed"
    (tmp_path / "relay.yaml").write_text("attacks: {type: gnss-freeze}")
    with BagWriter(tmp_path / "drive", provenance={"kind": "clean"}) as bag:
        for second in range(3):
            bag.write(CLOCK, clock(BEGIN_NS + second * 10**9), BEGIN_NS + second * 10**9)
            fix = fix_cdr(float(second), BEGIN_NS + second * 10**9)
            bag.write_cdr(VehicleTopics().gnss_fix, fix, BEGIN_NS + second * 10**9 + 1000)
    where = ["--ros2", "--domain", str(domain), "--interface", "lo"]
    playing = ["play", str(tmp_path / "drive"), *where, "--delay", "2", "--loop", "-q"]
    with relaying("--attack", str(tmp_path / "relay.yaml"), *where, "--out", str(out)) as process:
        wait_until_it_stands(process)
        with subprocess.Popen([*ADVPIPE, *playing]) as player:
            text, errors = process.communicate(timeout=120)
            player.terminate()
    assert process.returncode == 0, errors
    assert "until /clock jumped back by 2.0 s" in text
    times_ns = [raw.log_time_ns for raw in BagReader(out).raw_messages(["/ego/gnss/fix"])]
    assert 1 <= len(times_ns) <= 3
    assert times_ns == sorted(times_ns)


@pytest.mark.nightly
def test_it_waits_for_publishers_and_ends_after_its_duration(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedds")
    (tmp_path / "relay.yaml").write_text("attacks: {type: gnss-freeze}")
    domain = str(new_domain())
    where = ["--ros2", "--domain", domain, "--interface", "lo", "--out", str(tmp_path / "out")]
    arguments = ["relay", "--attack", str(tmp_path / "relay.yaml"), *where, "--duration", "4"]
    done = subprocess.run([*ADVPIPE, *arguments], capture_output=True, text=True)
    assert done.returncode == 0
    assert f"nobody publishes /ego/gnss/fix in domain {domain} yet; the relay waits" in done.stderr
    assert "0 in, 0 out" in done.stdout
    assert (tmp_path / "out" / "metadata.yaml").is_file()


@pytest.mark.nightly
@pytest.mark.oracle
def test_a_topic_of_another_type(tmp_path: Path) -> None:
    """Clouds where fixes should be."""
    pytest.importorskip("cyclonedds")
    domain = new_domain()
    (tmp_path / "relay.yaml").write_text(
        "attacks: {type: gnss-freeze}\nfix_topic: /ego/lidar/points\ncloud_topic: /other"
    )
    where = ["--ros2", "--domain", str(domain), "--interface", "lo", "--out", str(tmp_path / "out")]
    with relaying("--attack", str(tmp_path / "relay.yaml"), *where) as process:
        wait_until_it_stands(process)
        play(domain)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert without_progress(errors).endswith(  # after the notice that nobody publishes it yet
        "advpipe: /ego/lidar/points is published as sensor_msgs::msg::dds_::PointCloud2_, "
        "not sensor_msgs/msg/NavSatFix\n"
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "options", "line"),
    [
        ("attacks: {type: detach, recipe: random}", {"domain": None}, "name the DDS domain with domain"),
        ("attacks: {type: explode}", {}, "unknown attack 'explode'"),
        ("attacks: {type: gnss-freeze}", {"interface": "nix0"}, "this machine has no network interface nix0"),
        ("attacks: {type: gnss-drift, parameters: {speed: 1}}", {}, "gnss-drift: unknown parameter 'speed'"),
    ],
)
def test_refusals_are_one_line(tmp_path: Path, text: str, options: dict[str, Any], line: str) -> None:
    pytest.importorskip("cyclonedds")
    (tmp_path / "relay.yaml").write_text(text)
    with pytest.raises(UsageError) as found:
        relay(tmp_path / "relay.yaml", **{"domain": 9, "out": tmp_path / "out", **options})
    assert str(found.value).startswith(line)
    assert "\n" not in str(found.value)
    assert not (tmp_path / "out").exists()

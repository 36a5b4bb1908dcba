"""eProsima Fast DDS, which ROS 2 uses by default, as the other end: not the library that we publish with.

Needs a C++ compiler and the library's headers: apt-get install g++ libfastrtps-dev.
"""

import contextlib
import shutil
import subprocess
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from dds_process import new_domain

from advpipe.commands.play import play
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.dataset.sample import shipped_sample
from advpipe.pipeline.live.dds_types import dds_type_name
from advpipe.pipeline.messages.cloud import POINT_DTYPE, cloud_to_cdr
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import type_hash

pytestmark = [pytest.mark.nightly, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

SAMPLE = shipped_sample() / "clean"
CLOUDS = VehicleTopics().lidar_points
SOURCE = Path(__file__).parents[2] / "fastdds_subscriber.cpp"


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("cyclonedds")
    if shutil.which("g++") is None or not Path("/usr/include/fastdds").is_dir():
        pytest.skip("no g++, or no headers of Fast DDS")
    made = tmp_path_factory.mktemp("fastdds") / "subscriber"
    command = ["g++", "-O1", "-std=c++11", "-o", str(made), str(SOURCE), "-lfastrtps", "-lfastcdr"]
    subprocess.run(command, check=True)
    return made


class Seen:
    """What the subscriber printed: samples as topic, bytes and CRC-32, in their order."""

    def __init__(self, lines: list[str]) -> None:
        said = [line.split() for line in lines]
        self.samples = [(topic, int(size), int(crc)) for kind, topic, size, crc in said_of("sample", said)]
        self.publications = {topic: tuple(rest) for _, topic, *rest in said_of("publication", said)}
        self.participants = [line[1] for line in said_of("participant", said) if len(line) > 1]

    def on(self, topic: str) -> list[tuple[int, int]]:
        return [(size, crc) for name, size, crc in self.samples if name == topic]


def on_the_wire(cdr: bytes) -> bytes:
    """RTPS fills a message up to four bytes."""
    return cdr + bytes(-len(cdr) % 4)


def said_of(kind: str, said: list[list[str]]) -> list[list[str]]:
    return [line for line in said if line and line[0] == kind]


@contextlib.contextmanager
def fast_dds(program: Path, domain: int, seconds: int, *topics: tuple[str, str, str]) -> Iterator[list[Seen]]:
    """The list holds what was seen after the block."""
    wanted = [word for name, kind, qos in topics for word in (f"rt{name}", dds_type_name(kind), qos)]
    command = [str(program), str(domain), str(seconds), *wanted]
    seen: list[Seen] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            yield seen
            seen.append(Seen(process.communicate(timeout=seconds + 30)[0].splitlines()))
        finally:
            process.kill()


def test_every_byte_of_clouds_latched_topics_and_the_clock(program: Path) -> None:
    domain, reader = new_domain(), BagReader(SAMPLE)
    topics = {"/ego/lidar/points": "reliable", "/scenario/info": "latched", "/clock": "best_effort"}
    wanted = [(name, reader.topics[name].type, qos) for name, qos in topics.items()]
    with fast_dds(program, domain, 20, *wanted) as found:
        play(SAMPLE, ros2=True, domain=domain, interface="lo", delay_s=5)
    (seen,) = found
    for name in topics:
        sent = [on_the_wire(raw.cdr) for raw in reader.raw_messages([name])]
        expected = [(len(each), zlib.crc32(each)) for each in sent]
        assert seen.on(f"rt{name}") == expected, name
    assert seen.publications["rt/ego/lidar/points"] == (
        "sensor_msgs::msg::dds_::PointCloud2_",
        f"typehash={type_hash('sensor_msgs/msg/PointCloud2')};",
    )
    assert len(seen.publications) == 25  # with ros_discovery_info
    assert "enclave=/;" in seen.participants


@pytest.mark.parametrize(("qos", "least"), [("reliable", 50), ("best_effort", 49)])
def test_clouds_of_80_000_points_at_10_hz(tmp_path: Path, program: Path, qos: str, least: int) -> None:
    domain, rng = new_domain(), np.random.default_rng(1)
    cloud = np.zeros(80_000, POINT_DTYPE)
    for axis in "xyz":
        cloud[axis] = rng.normal(scale=30, size=len(cloud))
    with BagWriter(tmp_path / "clean", provenance={"kind": "clean"}, compression="none") as writer:
        for number in range(50):
            stamp_ns = 10**18 + number * 100_000_000
            writer.write_cdr(CLOUDS, cloud_to_cdr(cloud, stamp_ns, "ego/lidar"), stamp_ns)
    with fast_dds(program, domain, 25, (CLOUDS.name, CLOUDS.type, qos)) as found:
        play(tmp_path / "clean", ros2=True, domain=domain, interface="lo", delay_s=5)
    sizes = {size for size, _ in found[0].on(f"rt{CLOUDS.name}")}
    assert sizes == {len(on_the_wire(cloud_to_cdr(cloud, 0, "ego/lidar")))}
    assert least <= len(found[0].on(f"rt{CLOUDS.name}")) <= 50

"""DDS Security with an enclave's files, where Cyclone DDS is built with it; see docs/live.md."""

import time
from pathlib import Path

import pytest
from dds_process import dds_subscriber, new_domain
from dds_security import make_enclave, security_of

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import Topic

pytest.importorskip("cyclonedds")

from cyclonedds.__library__ import library_path
from dds_subscriber import LOOPBACK

from advpipe.pipeline.live.publisher import PublishedTopic
from advpipe.pipeline.live.ros2 import Ros2Publisher
from advpipe.pipeline.live.ros2_node import Ros2Node
from advpipe.pipeline.messages.build import string
from advpipe.pipeline.messages.types import schema_text, serialise

WORDS = Topic("/words", "std_msgs/msg/String")
IS_SECURE = any(Path(str(library_path)).parent.glob("*dds_security_auth*"))


@pytest.fixture
def security(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Of a new enclave, which our node uses, too."""
    section = security_of(make_enclave(tmp_path / "enclave"))
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK.replace("</Domain>", f"{section}</Domain>"))
    return section


@pytest.mark.skipif(not IS_SECURE, reason="this Cyclone DDS is built without security, as its wheels are")
def test_only_a_subscriber_with_the_keys_receives(security: str) -> None:
    domain = new_domain()
    publisher = Ros2Publisher(Ros2Node(domain))
    publisher.advertise(PublishedTopic(WORDS, schema_text(WORDS.type)))
    topic = ("rt/words", "string", "reliable")
    with (
        dds_subscriber(domain, topic, security=security) as seen_with_keys,
        dds_subscriber(domain, topic, patience_s=20) as seen_without,
    ):
        end_s = time.monotonic() + 15
        while time.monotonic() < end_s:
            publisher.publish(WORDS.name, serialise(string("secret"), WORDS.type), 0)
            time.sleep(0.2)
        samples, _ = seen_with_keys()
        others, publications = seen_without()
    publisher.close()
    assert {one["data"] for one in samples} == {"secret"}
    assert others == []
    assert publications == {}


@pytest.mark.oracle
@pytest.mark.skipif(IS_SECURE, reason="this Cyclone DDS is built with security")
def test_a_library_without_security_is_one_line(security: str) -> None:
    """Rather than publishing in the open."""
    with pytest.raises(AdvpipeError, match="Security: unknown element") as found:
        Ros2Node(new_domain())
    assert "\n" not in str(found.value)

"""Messages and labels of two bags by number, in memory that does not grow with them."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing

from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.verify.message_store import Message, MessageStore

SHORT, LONG = 5_000, 40_000
FLAT_MB = 4.0

FILL = """
import resource, sys
from contextlib import closing
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.verify.message_store import MessageStore
for count in map(int, sys.argv[1:]):
    with closing(MessageStore()) as store:
        for number in range(count):
            late = (number * 7919) % count
            store.add("clean", Sent(number, 0, number % 50, number, bytes(200), 23.0))
            store.add("forged", Sent(late, 0, late % 50, late, bytes(200), 23.0))
            store.add_label(0, {"number": late, "attack": "x" * 500})
        found = sum(len(diff.labels) for diff in store.diffs())
    print(found, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def sent(number: int, station_id: int, request_ns: int, payload: bytes) -> Sent:
    return Sent(number, 0, station_id, request_ns, payload, 23.0)


def test_messages_are_joined_with_their_labels() -> None:
    """By number, whatever the order; labels by their places, and then as they came."""
    with closing(MessageStore()) as store:
        assert store.add("clean", sent(2, 7, 20, b"b"))
        assert store.add("clean", sent(1, 7, 10, b"a"))
        assert not store.add("clean", sent(1, 7, 11, b"c"))
        assert store.add("forged", sent(3, 8, 15, b"d"))
        assert store.add("forged", sent(2, 7, 21, b"b"))
        for place, word in ((1, "later"), (0, "first"), (0, "second")):
            store.add_label(place, {"number": 3, "word": word})
        one, two, three = store.diffs()
        assert (one.number, one.clean, one.forged, one.labels) == (1, Message(7, 10, b"a"), None, [])
        assert (two.clean, two.forged) == (Message(7, 20, b"b"), Message(7, 21, b"b"))
        assert (three.clean, three.forged) == (None, Message(8, 15, b"d"))
        assert [row["word"] for row in three.labels] == ["first", "second", "later"]
        assert store.last_cam_of(7, 9) is None
        assert [store.last_cam_of(7, until_ns) for until_ns in (10, 19, 20, 99)] == [b"a", b"a", b"b", b"b"]
        assert store.last_cam_of(8, 99) is None


def test_messages_added_within_a_second_are_counted() -> None:
    """The second that ends with a message; each station and each attack by itself."""
    second = 1_000_000_000
    with closing(MessageStore()) as store:
        for number, (place, station_id, sent_ns) in enumerate(
            [(0, 7, 2 * second), (0, 7, second), (0, 8, second), (1, 7, second), (0, 7, second + 1)]
        ):
            store.add_added(place, {"number": number, "station_id": station_id, "sent_ns": sent_ns})
        assert [(one.number, one.in_a_second) for one in store.added()] == [
            *((1, 1), (4, 2), (0, 2)),
            *((2, 1), (3, 1)),
        ]


def test_memory_stays_flat() -> None:
    """In one process: the peak of the longer one is what it needs beyond the shorter one's."""
    done = subprocess.run(
        [sys.executable, "-c", FILL, str(SHORT), str(LONG)], capture_output=True, text=True, check=True
    )
    (short, first_mb), (long, peak_mb) = (line.split() for line in done.stdout.splitlines())
    assert (int(short), int(long)) == (SHORT, LONG)
    assert (LONG - SHORT) * 900 / 1e6 > 5 * FLAT_MB
    assert float(peak_mb) - float(first_mb) < FLAT_MB

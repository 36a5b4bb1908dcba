"""All sent messages of two bags and their labels, joined by message number."""

from __future__ import annotations

import heapq
import json
import sqlite3
from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter
from typing import Any, Literal, NamedTuple

from advpipe.pipeline.scenario.attacks import NS_PER_S
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.message_type import is_cam

Row = dict[str, Any]


class Message(NamedTuple):
    """A message of /v2x/sent: its sender, time and bytes."""

    station_id: int
    request_ns: int
    payload: bytes


class MessageDiff(NamedTuple):
    """One message in the clean and the adversarial bag, None if a bag lacks it, and its labels."""

    number: int
    clean: Message | None
    forged: Message | None
    labels: list[Row]


class Added(NamedTuple):
    """A message that an attack added. attack_index: of the attack; in_a_second: number of messages that it
    added by the same radio in the second that ends with this one."""

    attack_index: int
    station_id: int
    sent_ns: int
    number: int
    in_a_second: int


class MessageStore:
    """A temporary SQLite database, so that memory holds only a few pages.

    Message numbers in bags are not in order once messages are delayed or added. Raises sqlite3.Error if the
    disk is full, OverflowError for a number beyond 64 bits.
    """

    def __init__(self) -> None:
        self._database = sqlite3.connect("", isolation_level=None)
        for line in (
            "PRAGMA journal_mode = OFF",
            *(
                f"CREATE TABLE {name} "
                "(number INTEGER PRIMARY KEY, station_id INTEGER, request_ns INTEGER, payload BLOB)"
                for name in ("clean", "forged")
            ),
            "CREATE INDEX of_station ON clean (station_id, request_ns)",
            "CREATE TABLE labels (number INTEGER, attack_index INTEGER, line INTEGER, row TEXT, "
            "PRIMARY KEY (number, attack_index, line)) WITHOUT ROWID",
            "CREATE TABLE added (attack_index INTEGER, station_id INTEGER, sent_ns INTEGER, number INTEGER, "
            "PRIMARY KEY (attack_index, station_id, sent_ns, number)) WITHOUT ROWID",
            "BEGIN",
        ):
            self._database.execute(line)
        self._lines = 0

    def close(self) -> None:
        """Close and delete the database."""
        self._database.close()

    def add(self, bag: Literal["clean", "forged"], sent: Sent) -> bool:
        """Add a message of a bag; return whether it is the first with its number."""
        values = sent.number, sent.station_id, sent.request_ns, sent.payload
        return self._database.execute(f"INSERT OR IGNORE INTO {bag} VALUES (?, ?, ?, ?)", values).rowcount > 0

    def add_label(self, attack_index: int, row: Row) -> None:
        """Add a label of the attack with this index; a message's labels are returned by index, then as
        added."""
        self._lines += 1
        values = row["number"], attack_index, self._lines, json.dumps(row)
        self._database.execute("INSERT INTO labels VALUES (?, ?, ?, ?)", values)

    def add_added(self, attack_index: int, row: Row) -> None:
        """Add the label of an added message, to be counted by `added`."""
        values = attack_index, row["station_id"], row["sent_ns"], row["number"]
        self._database.execute("INSERT OR IGNORE INTO added VALUES (?, ?, ?, ?)", values)

    def added(self) -> Iterator[Added]:
        """The added messages by attack, station and time, each with the number added within a second."""
        yield from (
            Added(*found)
            for found in self._database.execute(
                "SELECT attack_index, station_id, sent_ns, number, "
                "COUNT(*) OVER (PARTITION BY attack_index, station_id "
                f"ORDER BY sent_ns RANGE BETWEEN {NS_PER_S - 1} PRECEDING AND CURRENT ROW) FROM added "
                "ORDER BY attack_index, station_id, sent_ns, number"
            )
        )

    def last_cam_of(self, station_id: int, until_ns: int) -> bytes | None:
        """The payload of a station's last CAM in the clean bag up to `until_ns`."""
        found = self._database.execute(
            "SELECT payload FROM clean WHERE station_id = ? AND request_ns <= ? "
            "ORDER BY request_ns DESC, number DESC",
            (station_id, until_ns),
        )
        return next((bytes(payload) for (payload,) in found if is_cam(bytes(payload))), None)

    def diffs(self) -> Iterator[MessageDiff]:
        """All messages with their labels, by number."""
        execute = self._database.execute
        columns = "number, station_id, request_ns, payload"
        merged = heapq.merge(
            (
                (row[0], 0, Message(*row[1:]))
                for row in execute(f"SELECT {columns} FROM clean ORDER BY number")
            ),
            (
                (row[0], 1, Message(*row[1:]))
                for row in execute(f"SELECT {columns} FROM forged ORDER BY number")
            ),
            (
                (number, 2, json.loads(text))
                for number, text in execute(
                    "SELECT number, row FROM labels ORDER BY number, attack_index, line"
                )
            ),
            key=itemgetter(0),
        )
        for number, parts in groupby(merged, itemgetter(0)):
            clean = forged = None
            labels: list[Row] = []
            for _, source, part in parts:
                if source == 0:
                    clean = part
                elif source == 1:
                    forged = part
                else:
                    labels.append(part)
            yield MessageDiff(number, clean, forged, labels)
